"""Gradient descriptor: how much the variation of the normals varies around each point (thesis 5.1.5)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.thesis.config import Descriptor
from weldsim.seam.thesis.grid import CellGrid


def gradient(points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], radius: float, kind: Descriptor) -> Float[ndarray, "n"]:
    """sigma^v of eq 5.23-5.24 within `radius` [m]: [rad^4] for "thesis", dimensionless for "code".

    "thesis": v = sqrt(var(theta)^2 + var(beta)^2), theta between the normals of centre and neighbour (eq 5.17), beta
    between a neighbour's normal and the cloud's mean normal (eq 5.18-5.19). "code": v = var(n_c . n_j).
    """
    from weldsim.seam.thesis import kernels

    grid = CellGrid.build(points, radius)
    n = normals[grid.order]
    v = np.empty(len(points))
    grid.run(kernels.normal_variance, n, kind == "thesis", v)
    if kind == "thesis":
        beta = np.arccos(np.clip(n @ unit(n.sum(axis=0)), -1.0, 1.0))
        var_beta = np.empty(len(points))
        grid.run(kernels.value_variance, beta, var_beta)
        v = np.hypot(v, var_beta)
    out = np.empty(len(points))
    grid.run(kernels.value_variance, v, out)
    return grid.unsort(out)
