"""Exact depth, geom ids, normals and shadows by ray casting (Embree through open3d): the back end where no OpenGL is to be
had, and the one that rendered infrared images are made with."""

from dataclasses import dataclass

import mujoco
import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Float32, Int32, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics
from weldsim.sensor.renderer import VISIBLE_GROUPS, Render, Renderer, dot, geom_colours, lengths
from weldsim.sensor.solids import Triangles, geom_triangles

AMBIENT, HEAD, OVERHEAD = 0.25, 0.45, 0.3  # shares of the light: everywhere, from the camera, from above


@dataclass(frozen=True, eq=False, kw_only=True)
class Hits:
    """What rays meet first, one through each pixel's centre.

    Attributes:
        z: depth along the optical axis [m], inf for a miss.  geom: id of the geom, -1 for a miss.
        directions: of the rays in W, as long as z = 1 takes.  normals: of the triangles in W, either side, 0 for a miss.
    """

    z: Float32[ndarray, "h w"]
    geom: Int32[ndarray, "h w"]
    directions: Float32[ndarray, "h w 3"]
    normals: Float32[ndarray, "h w 3"]


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
        hits = self.hits(data, X_WC, intrinsics)
        picture = self.shade(hits) if colour else None
        if not depth:
            return Render(depth=np.full_like(hits.z, np.nan), geom=np.full_like(hits.geom, -1), colour=picture)
        return Render(depth=np.where(np.isfinite(hits.z), hits.z, np.float32(np.nan)), geom=hits.geom, colour=picture)

    def hits(self, data: mujoco.MjData, X_WC: Transform, intrinsics: CameraIntrinsics) -> Hits:
        """What each pixel of a pinhole camera at X_WC meets first."""
        shape = (intrinsics.height, intrinsics.width, 3)
        directions = (self._directions(intrinsics) @ X_WC.R.T.astype(np.float32)).reshape(shape)
        return self.cast(data, np.broadcast_to(X_WC.p.astype(np.float32), shape), directions)

    def cast(self, data: mujoco.MjData, origins_W: Float32[ndarray, "h w 3"], directions_W: Float32[ndarray, "h w 3"]) -> Hits:
        """What any rays meet first; `z` is then in lengths of their directions."""
        self._place(data)
        rays = np.concatenate([origins_W, directions_W], axis=-1)
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        z = hit["t_hit"].numpy()
        seen = np.isfinite(z)
        geom = np.where(seen, self._geom_of_id[np.where(seen, hit["geometry_ids"].numpy(), 0)], -1).astype(np.int32)
        return Hits(z=z, geom=geom, directions=directions_W, normals=hit["primitive_normals"].numpy())

    def reached(
        self, data: mujoco.MjData, origin_W: Float[ndarray, "3"], points_W: Float32[ndarray, "h w 3"]
    ) -> Bool[ndarray, "h w"]:
        """Whether light from `origin_W` reaches each point [m]; a surface does not shade itself within 1/2000 of the way."""
        self._place(data)
        rays = np.empty((*points_W.shape[:2], 6), np.float32)
        rays[..., :3], rays[..., 3:] = origin_W, points_W - origin_W.astype(np.float32)
        rays[..., 3:][~np.isfinite(points_W).all(axis=-1)] = (0, 0, 1)
        return ~self._scene.test_occlusions(o3d.core.Tensor.from_numpy(rays), tnear=0.0, tfar=1 - 5e-4).numpy()

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

    def shade(self, hits: Hits) -> UInt8[ndarray, "h w 3"]:
        """A colour image: Lambert's law with a light at the camera and one overhead; black where nothing is."""
        cosine = np.abs(dot(hits.normals, hits.directions)) / lengths(hits.directions)
        light = AMBIENT + HEAD * cosine + OVERHEAD * np.clip(hits.normals[..., 2], 0.0, 1.0)
        shade = 255 * self._rgb[np.maximum(hits.geom, 0)] * light[..., None]
        return np.where((hits.geom >= 0)[..., None], np.clip(shade, 0, 255), 0).astype(np.uint8)
