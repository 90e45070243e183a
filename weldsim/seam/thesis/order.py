"""Order: unordered path points walked both ways from their geometric median (thesis 5.2.3, fig 5.16-5.19)."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial.distance import cdist


def walk_both_ways(points: Float[ndarray, "n 3"], radius: float) -> Int[ndarray, "m"]:
    """Indices of the points along the line, from one end to the other; points that the walk does not meet are left out.

    Each step goes to the nearest point within `radius` [m] less than 90 deg off the last step (eq 5.35). Unlike the
    published code it keeps a list of visited points, so it ends.
    """
    if len(points) < 2:
        return np.arange(len(points))
    distance = cdist(points, points)
    centre = int(distance.sum(axis=1).argmin())  # eq 5.34
    visited = np.zeros(len(points), bool)
    visited[centre] = True
    first = int(np.where(visited, np.inf, distance[centre]).argmin())
    if distance[centre, first] > radius:
        return np.array([centre])
    up = _walk(points, distance, visited, centre, points[first] - points[centre], radius)
    down = _walk(points, distance, visited, centre, points[centre] - points[first], radius)
    return np.array([*down[::-1], centre, *up])


def _walk(points: ndarray, distance: ndarray, visited: ndarray, at: int, heading: ndarray, radius: float) -> list[int]:
    """The points met from `at` onwards; marks them visited."""
    met: list[int] = []
    while True:
        ahead = (points - points[at]) @ heading > 0
        reach = np.where(ahead & ~visited, distance[at], np.inf)
        step = int(reach.argmin())
        if reach[step] > radius:
            return met
        heading = points[step] - points[at]
        visited[step] = True
        met.append(step)
        at = step
