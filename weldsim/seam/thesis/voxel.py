"""Voxel grid: the points of each cube merged into their centroid (the thesis's down-sampling, 5.2.3)."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray


def voxel_centroids(points: Float[ndarray, "n 3"], edge: float) -> tuple[Float[ndarray, "m 3"], Int[ndarray, "n"]]:
    """Centroid of the points in each occupied cube of an axis-aligned grid through the origin.

    Args:
        points: [m].  edge: of the cubes [m].
    Returns:
        centroids (m, 3) [m], and for each point the index of its cube.
    """
    cube = np.floor(points / edge).astype(np.int64)
    cube -= cube.min(axis=0)
    size = cube.max(axis=0) + 1
    key = (cube[:, 2] * size[1] + cube[:, 1]) * size[0] + cube[:, 0]
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    total = np.stack([np.bincount(inverse, column, len(count)) for column in points.T], axis=1)
    return total / count[:, None], inverse
