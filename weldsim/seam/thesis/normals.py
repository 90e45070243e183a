"""Normals: the direction of least scatter of each neighbourhood, turned towards the camera (thesis 5.1.3-5.1.4)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.seam.thesis.grid import CellGrid


def principal_axes(
    points: Float[ndarray, "n 3"], radius: float
) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"], Float[ndarray, "n 3 3"]]:
    """Count, centroid [m] and principal axes of each point's neighbourhood, columns from widest to narrowest scatter
    (eq 5.5-5.13): the last column is the normal, of either sign."""
    from weldsim.seam.thesis import kernels

    grid = CellGrid.build(points, radius)
    n = len(points)
    count, mean, covariance = np.empty(n), np.empty((n, 3)), np.empty((n, 3, 3))
    grid.run(kernels.covariances, count, mean, covariance)
    axes = np.linalg.eigh(covariance)[1][:, :, ::-1]
    return grid.unsort(count), grid.unsort(mean), grid.unsort(np.ascontiguousarray(axes))


def normals_towards(points: Float[ndarray, "n 3"], sight: Float[ndarray, "n 3"] | None, radius: float) -> Float[ndarray, "n 3"]:
    """Unit normals by PCA within `radius` [m], each within 90 deg of its sight direction (eq 5.15-5.16).

    Args:
        points: (n, 3) [m].  sight: (n, 3) where the camera that saw each point stood [m]; None = above (+z).
    """
    return towards(points, principal_axes(points, radius)[2][:, :, 2], sight)


def towards(
    points: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"], sight: Float[ndarray, "n 3"] | None
) -> Float[ndarray, "n 3"]:
    """The directions, reversed where they point away from the camera (eq 5.16)."""
    view = np.broadcast_to([0.0, 0.0, 1.0], points.shape) if sight is None else sight - points
    return np.where(np.einsum("ij,ij->i", directions, view)[:, None] < 0, -directions, directions)
