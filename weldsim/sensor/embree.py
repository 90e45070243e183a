"""Exact depth, geom ids and plain colour by ray casting (Embree through open3d), where no OpenGL is to be had."""

import mujoco
import numpy as np
import open3d as o3d
from jaxtyping import Float32, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics
from weldsim.sensor.renderer import VISIBLE_GROUPS, Render, Renderer, geom_colours
from weldsim.sensor.solids import Triangles, geom_triangles

AMBIENT, HEAD, OVERHEAD = 0.25, 0.45, 0.3  # shares of the light: everywhere, from the camera, from above


class EmbreeRenderer(Renderer):
    """Casts one ray through each pixel's centre at the triangles of every visible geom."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.backend = "embree"
        rgba = geom_colours(model)
        self._rgb = rgba[:, :3]
        self._geoms = [g for g in range(model.ngeom) if model.geom_group[g] < VISIBLE_GROUPS and rgba[g, 3] > 0]
        self._triangles: list[Triangles] = [geom_triangles(model, g) for g in self._geoms]
        self._placed: tuple[ndarray, ndarray] | None = None
        self._rays_C: tuple[tuple[float, ...], Float32[ndarray, "n 3"]] | None = None
        self._scene = o3d.t.geometry.RaycastingScene()
        self._geom_of_id = np.zeros(1, np.int32)

    def render(
        self, data: mujoco.MjData, X_WC: Transform, intrinsics: CameraIntrinsics, *, colour: bool = True, depth: bool = True
    ) -> Render:
        self._place(data)
        directions = self._directions(intrinsics) @ X_WC.R.T.astype(np.float32)
        rays = np.empty((intrinsics.height, intrinsics.width, 6), np.float32)
        rays[..., :3], rays[..., 3:] = X_WC.p, directions.reshape(intrinsics.height, intrinsics.width, 3)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        z = hit["t_hit"].numpy()
        seen = np.isfinite(z)
        geom = np.where(seen, self._geom_of_id[np.where(seen, hit["geometry_ids"].numpy(), 0)], -1).astype(np.int32)
        picture = self._shade(geom, hit["primitive_normals"].numpy(), directions) if colour else None
        if not depth:
            return Render(depth=np.full_like(z, np.nan), geom=np.full_like(geom, -1), colour=picture)
        return Render(depth=np.where(seen, z, np.float32(np.nan)), geom=geom, colour=picture)

    def _directions(self, i: CameraIntrinsics) -> Float32[ndarray, "n 3"]:
        """Rays with z = 1 in C, so that the distance along a ray is the z-depth itself; kept for the next view."""
        key = (i.width, i.height, i.fx, i.fy, i.cx, i.cy)
        if self._rays_C is None or self._rays_C[0] != key:
            self._rays_C = (key, i.rays().reshape(-1, 3).astype(np.float32))
        return self._rays_C[1]

    def close(self) -> None:
        self._scene, self._placed = o3d.t.geometry.RaycastingScene(), None

    def _place(self, data: mujoco.MjData) -> None:
        """Builds the ray-casting scene for the present geom poses, unless it stands already."""
        p, R = data.geom_xpos[self._geoms], data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        if self._placed is not None and np.array_equal(self._placed[0], p) and np.array_equal(self._placed[1], R):
            return
        self._scene = o3d.t.geometry.RaycastingScene()
        ids = []
        for k, solid in enumerate(self._triangles):
            vertices = (solid.vertices @ R[k].T + p[k]).astype(np.float32)
            ids.append(self._scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(solid.faces)))
        self._geom_of_id = np.zeros(max(ids, default=0) + 1, np.int32)
        self._geom_of_id[ids] = self._geoms
        self._placed = (p.copy(), R.copy())

    def _shade(
        self, geom: ndarray, normals: Float32[ndarray, "h w 3"], directions: Float32[ndarray, "n 3"]
    ) -> UInt8[ndarray, "h w 3"]:
        """Lambert's law with a light at the camera and one overhead; black where nothing is."""
        view = directions.reshape(normals.shape)
        cosine = np.abs(np.sum(normals * view, axis=-1)) / np.linalg.norm(view, axis=-1)
        light = AMBIENT + HEAD * cosine + OVERHEAD * np.clip(normals[..., 2], 0.0, 1.0)
        shade = 255 * self._rgb[np.maximum(geom, 0)] * light[..., None]
        return np.where((geom >= 0)[..., None], np.clip(shade, 0, 255), 0).astype(np.uint8)
