"""A block or plate with a groove over one or three of its faces, seen by several cameras whose poses are not quite true.

Rays are cast against the solid and a table; each view then gets the errors of a real cell: an offset of its depth, a
mistaken hand-eye calibration (the same in every camera frame), noise. Nothing of it needs the simulator.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import manifold3d
import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tests.clouds import d415_depth
from weldsim.cloud.deproject import deproject
from weldsim.frames import Transform, matrix_from_rotation_vector, unit
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud

Noise = Literal["none", "iid", "d415"]

CENTRE = np.array([0.0, -0.55, 0.0])  # [m] of the block's foot in B
FAN = (-70.0, -35.0, 0.0, 35.0, 70.0)  # [deg] from the vertical, about the block's y: five views over the three faces
NARROW = CameraIntrinsics(width=320, height=240, fx=310.0, fy=310.0, cx=160.0, cy=120.0)


class Block(NamedTuple):
    """A solid on the table. size: x, y, z [m]. groove: width, depth [m]. sides: whether the groove goes down both ends."""

    size: tuple[float, float, float] = (0.42, 0.20, 0.33)
    groove: tuple[float, float] = (0.014, 0.008)
    sides: bool = True

    def solid(self) -> manifold3d.Manifold:
        x, y, z = self.size
        width, depth = self.groove
        block = manifold3d.Manifold.cube(self.size).translate((-x / 2, -y / 2, 0))
        if width == 0:
            return block
        rise = 1.25
        half, high = rise * width / 2, (rise - 1) * depth
        section = manifold3d.CrossSection([[[-half, high], [0.0, -depth], [half, high]]])
        if section.area() <= 0:
            section = manifold3d.CrossSection([[[half, high], [0.0, -depth], [-half, high]]])
        across = section.extrude(2 * x + 2 * z).translate((0, 0, -x - z)).rotate((90, 0, 90))  # along x, opening to +z
        block -= across.translate((0, 0, z))
        if self.sides:
            for sign in (-1, 1):
                block -= across.rotate((0, sign * 90, 0)).translate((sign * x / 2, 0, z / 2))
        return block

    def seam(self, step: float = 1e-3) -> Float[ndarray, "n 3"]:
        """Opening's centre line in B, from one foot over the top to the other."""
        x, _, z = self.size
        corners = (
            [(-x / 2, 0.0, 0.0), (-x / 2, 0.0, z), (x / 2, 0.0, z), (x / 2, 0.0, 0.0)]
            if self.sides
            else [(-x / 2, 0, z), (x / 2, 0, z)]
        )
        lines = [
            np.linspace(a, b, max(2, int(np.ceil(np.linalg.norm(np.subtract(b, a)) / step)) + 1)) for a, b in pairwise(corners)
        ]
        return np.concatenate(lines) + CENTRE


class Scan(NamedTuple):
    """Attributes: clouds and frames as a cell with mistakes sees them.  true: X_BC of each view.  offsets: of its depth [m].
    groove: for each cloud, which points lie in the groove."""

    clouds: list[PointCloud]
    frames: list[DepthFrame]
    true: list[Transform]
    offsets: Float[ndarray, "k"]
    groove: list[Bool[ndarray, "_"]]

    def places(self, view: int, every: int = 7) -> tuple[Float[ndarray, "n 3"], Int[ndarray, "n"]]:
        """Where groove points of a view would lie in B without the cell's mistakes (noise apart), and their rows."""
        cloud, rows = self.clouds[view], np.flatnonzero(self.groove[view])[::every]
        seen = self.frames[view].X_BC.inverse().points(cloud.points[rows])
        return self.true[view].points(seen * (1 - self.offsets[view] / seen[:, 2:])), rows

    def misalignment(self, clouds: Sequence[PointCloud]) -> float:
        """Rms distance of the views' grooves from each other [m]: what is left after the motion common to all is taken out."""
        right, now = zip(*((self.places(i)[0], cloud.points[self.places(i)[1]]) for i, cloud in enumerate(clouds)), strict=True)
        return float(np.sqrt(np.mean(fit_motion(np.concatenate(right), np.concatenate(now))[1] ** 2)))

    def error(self, clouds: Sequence[PointCloud]) -> float:
        """Rms distance of the grooves from where they are [m]."""
        gaps = [cloud.points[self.places(i)[1]] - self.places(i)[0] for i, cloud in enumerate(clouds)]
        return float(np.sqrt((np.concatenate(gaps) ** 2).sum(axis=1).mean()))


def fit_motion(a: Float[ndarray, "n 3"], b: Float[ndarray, "n 3"]) -> tuple[Transform, Float[ndarray, "n"]]:
    """The rigid motion that best carries points a to b (singular value decomposition), and the distances left [m]."""
    u, _, vt = np.linalg.svd((a - a.mean(axis=0)).T @ (b - b.mean(axis=0)))
    R = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    X = Transform("BB", R, b.mean(axis=0) - R @ a.mean(axis=0))
    return X, np.linalg.norm(b - X.points(a), axis=1)


def look(
    target: Float[ndarray, "3"], towards: Float[ndarray, "3"], standoff: float, up: Sequence[float] = (0.0, 1.0, 0.0)
) -> Transform:
    """X_BC of a camera at target + standoff * towards, looking at it."""
    z = -unit(np.asarray(towards, float))
    x = unit(np.cross(np.asarray(up, float), z))
    return Transform("BC", np.stack([x, np.cross(z, x), z], axis=1), target - standoff * z)


def fan(block: Block, angles: Sequence[float] = FAN, standoff: float = 0.42, lean: float = 0.0) -> list[Transform]:
    """Views about the block's y axis, each aimed at the seam's nearest place."""
    x, _, z = block.size
    poses = []
    for angle in np.radians(angles):
        towards = np.array([np.sin(angle), np.sin(lean), np.cos(angle)])
        aim = np.array(
            [np.clip(np.sin(angle) * 1.2, -1, 1) * x / 2, 0.0, z - (max(0.0, abs(np.sin(angle)) - 0.6) * z if block.sides else 0.0)]
        )
        poses.append(look(CENTRE + aim, towards, standoff))
    return poses


def scan(
    rng: np.random.Generator,
    block: Block | None = None,
    views: Sequence[Transform] | None = None,
    *,
    noise: Noise = "none",
    sigma: float = 0.0004,
    offset: float = 0.0,
    offsets: Sequence[float] | None = None,
    hand_eye: float = 0.0,
    hand_eye_turn: float = 0.0,
    table: bool = True,
    intrinsics: CameraIntrinsics = D415_640X480,
) -> Scan:
    """What the views see.

    Args:
        noise, sigma: of depth [m].  offset: standard deviation of each view's depth offset [m], or `offsets` themselves.
        hand_eye, hand_eye_turn: length [m] and angle [rad] of the mistake between flange and camera, alike in all views.
    """
    block = block or Block()
    views = list(views or fan(block))
    along = np.asarray(offsets, float) if offsets is not None else offset * rng.standard_normal(len(views))
    mistake = Transform(
        "CC", matrix_from_rotation_vector(hand_eye_turn * unit(rng.standard_normal(3))), hand_eye * unit(rng.standard_normal(3))
    )
    scene = _scene(block, table)
    frames, groove = [], []
    for X_BC, shift in zip(views, along, strict=True):
        z, hit = _cast(scene, X_BC, intrinsics)
        if noise == "iid":
            z = z + rng.normal(0.0, sigma, z.shape)
        elif noise == "d415":
            z = d415_depth(z, intrinsics.fx, rng)
        z = np.where(z + shift > 0, z + shift, np.nan)
        frame = DepthFrame(depth=z.astype(np.float32), intrinsics=intrinsics, X_BC=X_BC @ mistake)
        frames.append(frame)
        groove.append(_in_groove(block, hit).ravel()[np.isfinite(z.ravel())])
    return Scan([deproject(frame) for frame in frames], frames, views, along, groove)


def _scene(block: Block, table: bool) -> o3d.t.geometry.RaycastingScene:
    scene, mesh = o3d.t.geometry.RaycastingScene(), block.solid().to_mesh()
    meshes = [(np.asarray(mesh.vert_properties, float)[:, :3] + CENTRE, np.asarray(mesh.tri_verts))]
    if table:
        meshes.append((np.array([[-1.0, -1.5, 0], [1, -1.5, 0], [1, 0.5, 0], [-1, 0.5, 0]]), np.array([[0, 1, 2], [0, 2, 3]])))
    for vertices, faces in meshes:
        scene.add_triangles(o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(faces.astype(np.uint32)))
    return scene


def _cast(
    scene: o3d.t.geometry.RaycastingScene, X_BC: Transform, intrinsics: CameraIntrinsics
) -> tuple[Float[ndarray, "h w"], Float[ndarray, "h w 3"]]:
    directions = intrinsics.rays() @ X_BC.R.T
    rays = np.concatenate([np.broadcast_to(X_BC.p, directions.shape), directions], axis=-1).astype(np.float32)
    z = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().astype(float)
    z[np.isinf(z) | (z > 2.0)] = np.nan
    return z, X_BC.p + directions * z[..., None]


def _in_groove(block: Block, hit: Float[ndarray, "h w 3"]) -> Bool[ndarray, "h w"]:
    """Inside the block's outline by more than rounding, between the lips."""
    p, (x, _, z) = hit - CENTRE, block.size
    deep = np.minimum(x / 2 - np.abs(p[..., 0]), z - p[..., 2]) > 2e-5
    return deep & (np.abs(p[..., 1]) < block.groove[0] / 2 + 1e-4) & (p[..., 2] > 1e-4) & (np.abs(p[..., 0]) < x / 2)
