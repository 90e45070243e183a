"""Exact depth in closed form of prismatic surfaces, for tests of the depth model without rendering."""

from itertools import pairwise

import numpy as np
from numpy import ndarray

from weldsim.records import CameraIntrinsics

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
