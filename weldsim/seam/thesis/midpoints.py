"""Midpoints: half way from each boundary point to its partner on the opposite edge (thesis 5.2.2)."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def midpoints(edge: Float[ndarray, "n 3"], step: float, limit: float, tolerance: float) -> Float[ndarray, "m 3"]:
    """Raw path points [m], one for each boundary point that found a partner (eq 5.28-5.32).

    Args:
        edge: boundary points [m].  step, limit: first radius and growth, and last radius, of the search [m].
        tolerance: epsilon about the right angle [rad].
    """
    from weldsim.seam.thesis import kernels

    partner = np.full(len(edge), -1, np.int64)
    kernels.partners(np.ascontiguousarray(edge), step, limit, float(np.sin(tolerance)), partner)
    found = partner >= 0
    return (edge[found] + edge[partner[found]]) / 2
