"""Thinning: raw path points drawn together by centroid passes, then merged (thesis 5.2.3, fig 5.14)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.seam.thesis.grid import CellGrid
from weldsim.seam.thesis.voxel import voxel_centroids


def thin(points: Float[ndarray, "n 3"], radius: float, passes: int, voxel: float) -> Float[ndarray, "m 3"]:
    """Points [m] after `passes` replacements of each by its neighbours' centroid (eq 5.33), one a cube of edge `voxel`."""
    from weldsim.seam.thesis import kernels

    for _ in range(passes):
        grid = CellGrid.build(points, radius)
        moved = np.empty_like(grid.points)
        grid.run(kernels.centroids, moved)
        moved = grid.unsort(moved)
        if np.array_equal(moved, points):  # nothing will move any more
            break
        points = moved
    return voxel_centroids(points, voxel)[0]
