"""Exact depth in closed form of prismatic surfaces, for tests of the depth model without rendering."""

from itertools import pairwise

import mujoco
import numpy as np
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Finish, Label, View
from weldsim.sensor.exact import TwinScene

FLAT = [(-10.0, 0.0), (10.0, 0.0)]


def v_groove(width: float, depth: float) -> list[tuple[float, float]]:
    """Profile (x, height) of a plate's top with a V along y, lips at x = -width/2 and +width/2 [m]."""
    return [(-10.0, 0.0), (-width / 2, 0.0), (0.0, -depth), (width / 2, 0.0), (10.0, 0.0)]


def fillet() -> list[tuple[float, float]]:
    """Two plates at 90 degrees, each 45 degrees to the camera, their corner at x = 0 farthest away."""
    return [(-10.0, 10.0), (0.0, 0.0), (10.0, 10.0)]


def profile_depth(
    intrinsics: CameraIntrinsics, profile: list[tuple[float, float]], z: float, *, rotation: float = 0.0, tilt: float = 0.0
) -> ndarray:
    """z-depth (h, w) float32 of the profile drawn out along its y.

    The part's frame lies `z` ahead of the camera [m], its height axis towards the camera, turned by `rotation` about the
    optical axis and then tilted by `tilt` about the camera's x [rad].
    """
    R_PC, origin = part_from_camera(z, rotation, tilt)
    direction = intrinsics.rays() @ R_PC.T
    best = np.full(direction.shape[:2], np.inf)
    for (x0, h0), (x1, h1) in pairwise(profile):
        slope = (h1 - h0) / (x1 - x0)
        # On the segment h = h0 + slope (x - x0), with x = ox + t dx and h = oz + t dz.
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (h0 + slope * (origin[0] - x0) - origin[2]) / (direction[..., 2] - slope * direction[..., 0])
        x = origin[0] + t * direction[..., 0]
        hit = (t > 0) & (x >= x0 - 1e-12) & (x <= x1 + 1e-12)
        best = np.where(hit & (t < best), t, best)
    return np.where(np.isfinite(best), best, np.nan).astype(np.float32)


def part_from_camera(z: float, rotation: float = 0.0, tilt: float = 0.0) -> tuple[ndarray, ndarray]:
    """R_PC and the camera's position in P [m]."""
    c, s = np.cos(rotation), np.sin(rotation)
    ct, st = np.cos(tilt), np.sin(tilt)
    R_CP = (
        np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag([1.0, -1.0, -1.0])
    )
    return R_CP.T, -R_CP.T @ np.array([0.0, 0.0, z])


def points_in_part(intrinsics: CameraIntrinsics, depth: ndarray, z: float, *, rotation: float = 0.0, tilt: float = 0.0) -> ndarray:
    """Points (h, w, 3) in the part's frame of a depth image [m]."""
    R_PC, origin = part_from_camera(z, rotation, tilt)
    return (intrinsics.rays() * depth[..., None].astype(float)) @ R_PC.T + origin


def profile_scene(
    profile: list[tuple[float, float]],
    z: float,
    *,
    rotation: float = 0.0,
    tilt: float = 0.0,
    finish: Finish = Finish.MATTE,
    reach: float = 0.6,
) -> tuple[TwinScene, View]:
    """The same surface as a mesh to render, cut off `reach` from the middle [m], and the view that `profile_depth` has of it."""
    line = np.array(profile, float)
    x = np.unique(np.clip(line[:, 0], -reach, reach))
    corners = [(u, y, h) for y in (-reach, reach) for u, h in zip(x, np.interp(x, line[:, 0], line[:, 1]), strict=True)]
    n = len(x)
    faces = [face for k in range(n - 1) for face in ((k, k + 1, k + n + 1), (k, k + n + 1, k + n))]
    text = [" ".join(f"{value:.9g}" for value in np.ravel(array)) for array in (corners, faces)]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" inertia="shell" vertex="{text[0]}" face="{text[1]}"/></asset><worldbody>'
        '<geom type="mesh" mesh="m" contype="0" conaffinity="0"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # MuJoCo moves a mesh to its own centre and turns it to its axes of inertia; the geom's pose says how, so W stays P.
    R_PC, origin = part_from_camera(z, rotation, tilt)
    scene = TwinScene(
        model=model,
        data=data,
        X_WB=Transform("WB", np.eye(3), np.zeros(3)),
        labels=np.full(1, Label.PART, np.uint8),
        finishes=np.full(1, finish, np.uint8),
    )
    return scene, View(X_BC=Transform("BC", R_PC, origin))
