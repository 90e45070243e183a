"""Polylines in space: arc length, tangents, resampling and nearest points, for every stage that handles a seam."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.frames import unit

SAME = 1e-9  # [m] ends of a polyline so near to one another make it a closed one


def arc_length(points: Float[ndarray, "n d"]) -> Float[ndarray, "n"]:
    """Cumulative chord length from the first point [same unit as points]."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def tangents(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Unit tangents by second-order differences over arc length, one-sided at the ends."""
    if len(points) == 2:
        return np.repeat(unit(points[1:] - points[:1]), 2, axis=0)
    return unit(np.gradient(points, arc_length(points), axis=0))


def interpolate(s: Float[ndarray, "n"], values: Float[ndarray, "n d"], at: Float[ndarray, "m"]) -> Float[ndarray, "m d"]:
    """`values` linearly interpolated over `s` at `at`, constant beyond the ends."""
    return np.stack([np.interp(at, s, column) for column in values.T], axis=1)


def resample(points: Float[ndarray, "n d"], step: float) -> Float[ndarray, "m d"]:
    """Points evenly spaced along the polyline, at most `step` apart, both ends kept."""
    s = arc_length(points)
    return interpolate(s, points, np.linspace(0.0, s[-1], max(2, int(np.ceil(s[-1] / step)) + 1)))


def project(
    queries: Float[ndarray, "m 3"], points: Float[ndarray, "n 3"]
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m 3"], Float[ndarray, "m"]]:
    """Nearest point of the polyline to each query.

    Returns:
        distance: (m,) to the polyline.  foot: (m, 3) the nearest point on it.
        s: (m,) its arc length; the first and last segments are not extended.
    """
    length = arc_length(points)
    _, nearest = KDTree(points).query(queries)
    best = np.full(len(queries), np.inf)
    foot, at = np.empty((len(queries), queries.shape[1])), np.zeros(len(queries))
    closed = len(points) > 2 and bool(np.linalg.norm(points[-1] - points[0]) <= SAME)  # its ends are each other's neighbours
    for shift in (-1, 0):
        i = (nearest + shift) % (len(points) - 1) if closed else np.clip(nearest + shift, 0, len(points) - 2)
        a, d = points[i], points[i + 1] - points[i]
        u = np.clip(np.einsum("ij,ij->i", queries - a, d) / np.maximum(np.einsum("ij,ij->i", d, d), 1e-30), 0.0, 1.0)
        candidate = a + u[:, None] * d
        distance = np.linalg.norm(queries - candidate, axis=1)
        closer = distance < best
        best = np.where(closer, distance, best)
        foot[closer] = candidate[closer]
        at = np.where(closer, length[i] + u * np.linalg.norm(d, axis=1), at)
    return best, foot, at
