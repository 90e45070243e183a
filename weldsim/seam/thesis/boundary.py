"""Boundary: the points of a groove region whose neighbours leave a wide sector empty (thesis 5.2.1).

Eq 5.25-5.27 compare the mean neighbour offset with its range over an unprinted constant C; the published code uses the
sector test instead, and so does this.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.thesis.grid import CellGrid
from weldsim.seam.thesis.normals import principal_axes


def boundary(points: Float[ndarray, "n 3"], normal_radius: float, radius: float, angle: float) -> Bool[ndarray, "n"]:
    """Which points have an empty sector wider than `angle` [rad] among neighbours within `radius` [m], seen along
    normals fitted within `normal_radius` [m]."""
    from weldsim.seam.thesis import kernels

    axes = principal_axes(points, normal_radius)[2]
    grid = CellGrid.build(points, radius)
    u, v = (np.ascontiguousarray(axes[grid.order, :, k]) for k in (0, 1))
    gap = np.empty(len(points))
    grid.run(kernels.widest_gap, u, v, gap)
    return grid.unsort(gap) > angle
