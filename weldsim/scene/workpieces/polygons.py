"""Plane polygons of many corners, convex or not, cut into triangles."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray


def triangulated(points: Float[ndarray, "v 3"], polygons: Sequence[Sequence[int]]) -> Int[ndarray, "f 3"]:
    """Triangles with the winding of the polygons they are cut from.

    Args:
        points: (v, 3).  polygons: the corners of each, in order, as indices of points.
    """
    triangles: list[tuple[int, int, int]] = []
    for corners in polygons:
        triangles += [(corners[0], corners[1], corners[2])] if len(corners) == 3 else _ears(points, list(corners))
    return np.array(triangles, np.int64).reshape(-1, 3)


def _ears(points: Float[ndarray, "v 3"], corners: list[int]) -> list[tuple[int, int, int]]:
    """One polygon, an ear at a time: a corner that bulges out and whose triangle holds no other corner."""
    flat = _flattened(points[corners])
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        at = next((i for i in range(len(left)) if _is_ear(flat, left, i)), None)
        if at is None:  # one that crosses itself: its sharpest corner will have to do
            at = max(range(len(left)), key=lambda i: _area(flat, left, i))
        triangles.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    triangles.append((left[0], left[1], left[2]))
    return [(corners[a], corners[b], corners[c]) for a, b, c in triangles]


def _flattened(points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 2"]:
    """The corners in their plane, counter-clockwise."""
    centred = points - points.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)  # twice the area, whatever its shape
    if np.linalg.norm(normal) == 0:
        return centred[:, :2]
    normal = normal / np.linalg.norm(normal)
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first = first / np.linalg.norm(first)
    return np.stack([centred @ first, centred @ np.cross(normal, first)], axis=1)


def _area(flat: Float[ndarray, "n 2"], left: list[int], i: int) -> float:
    """Twice the signed area of the triangle at corner i."""
    a, b, c = flat[left[i - 1]], flat[left[i]], flat[left[(i + 1) % len(left)]]
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _is_ear(flat: Float[ndarray, "n 2"], left: list[int], i: int) -> bool:
    """Whether the triangle at corner i lies inside the polygon and can be cut off."""
    size = float(np.abs(flat).max()) ** 2
    if _area(flat, left, i) <= 1e-12 * size:
        return False
    a, b, c = left[i - 1], left[i], left[(i + 1) % len(left)]
    others = flat[[k for k in left if k not in (a, b, c)]]
    inside = np.ones(len(others), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, to = flat[end] - flat[start], others - flat[start]
        inside &= edge[0] * to[:, 1] - edge[1] * to[:, 0] >= -1e-12 * size
    return not inside.any()
