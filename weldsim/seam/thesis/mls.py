"""Moving least squares: each point moved onto a smooth surface through its neighbours (thesis 5.1.2)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.seam.thesis.grid import CellGrid
from weldsim.seam.thesis.normals import principal_axes


def smooth(points: Float[ndarray, "n 3"], radius: float) -> Float[ndarray, "n 3"]:
    """The points on their local quadratics over the PCA plane, Gaussian weights of scale `radius` [m].

    Fewer than six neighbours project onto the plane, fewer than three stay. No points are added.
    """
    from weldsim.seam.thesis import kernels

    count, mean, axes = principal_axes(points, radius)
    grid = CellGrid.build(points, radius)
    out = np.empty_like(grid.points)
    grid.run(kernels.mls, count[grid.order], mean[grid.order], axes[grid.order], out)
    return grid.unsort(out)
