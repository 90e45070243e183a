"""Axes: travel direction and surface normal at each path point (thesis 5.2.4)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.frames import unit


def travel(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Unit travel directions P_i - P_(i-1) (eq 5.48); the first point takes the second's."""
    steps = unit(np.diff(points, axis=0))
    return np.concatenate([steps[:1], steps])


def plane_normals(points: Float[ndarray, "n 3"], surface: Float[ndarray, "m 3"], radius: float) -> Float[ndarray, "n 3"]:
    """Unit normals, of either sign, of the planes fitted to the `surface` points within `radius` [m] of each path point
    (eq 5.36-5.47); where fewer than three lie there, to the three nearest."""
    tree = KDTree(surface)
    out = np.empty_like(points)
    for i, near in enumerate(tree.query_ball_point(points, radius, return_sorted=True)):
        chosen = near if len(near) >= 3 else tree.query(points[i], k=3)[1]
        local = surface[chosen]
        out[i] = np.linalg.eigh(np.cov(local.T, bias=True))[1][:, 0]
    return out
