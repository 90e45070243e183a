"""Seams of a surface closed: vertices of its borders that lie together made one, and facets parted where others' vertices lie
on their edges (T-junctions), as modellers leave them where faces were cut into facets apart from one another.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from weldsim.scene.workpieces.polygons import triangulated

ROUNDS = 4  # a facet that was parted may have to be parted again


@dataclass(frozen=True, eq=False)
class Stitched:
    """Attributes:
    vertices, faces: of the surface, borders stitched.
    parted: how many vertices lay on edges of other facets.
    gap: the widest that was closed, in the unit of the vertices.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    parted: int
    gap: float


def stitched(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], tolerance: float) -> Stitched:
    """The surface with what lies within `tolerance` along its borders joined; the rest is left as it is.

    Args:
        vertices: (v, 3), one for each place.  faces: (f, 3).
    """
    parted, gap = 0, 0.0
    for _ in range(ROUNDS):
        border = _border(faces)
        if not len(border):
            break
        faces, apart = _joined(vertices, faces, np.unique(border), tolerance)
        border = _border(faces)
        vertices, faces, number, off = _parted(vertices, faces, border, tolerance)
        parted, gap = parted + number, max(gap, apart, off)
        if number == 0:
            break
    return Stitched(vertices, faces, parted, gap)


def without_slivers(faces: Int[ndarray, "f 3"]) -> Int[ndarray, "g 3"]:
    """The faces that have three different corners."""
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)]


def _border(faces: Int[ndarray, "f 3"]) -> Int[ndarray, "e 2"]:
    """Edges that have one face only, as pairs of vertices, the lower first."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_counts=True)
    return unique[number == 1]


def _joined(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], among: Int[ndarray, "k"], tolerance: float
) -> tuple[Int[ndarray, "g 3"], float]:
    """Faces in which vertices of the border that lie together are one, and how far apart they were."""
    pairs = KDTree(vertices[among]).query_pairs(tolerance, output_type="ndarray") if len(among) else np.zeros((0, 2), np.int64)
    if not len(pairs):
        return faces, 0.0
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(among), len(among)))
    _, group = connected_components(graph, directed=False)
    _, first = np.unique(group, return_index=True)
    which = np.arange(len(vertices))
    which[among] = among[first[group]]
    moved = np.linalg.norm(vertices[which] - vertices, axis=1)
    if moved.max() > 2 * tolerance:  # a chain of them, as about a hole
        return faces, 0.0
    return without_slivers(which[faces]), float(moved.max())


def _parted(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], border: Int[ndarray, "e 2"], tolerance: float
) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "g 3"], int, float]:
    """Faces cut at the vertices of the border that lie on their edges; how many vertices, and how far off the edges they lay."""
    if not len(border):
        return vertices, faces, 0, 0.0
    among = np.unique(border)
    tree = KDTree(vertices[among])
    start, end = vertices[border[:, 0]], vertices[border[:, 1]]
    length = np.linalg.norm(end - start, axis=1)
    near = tree.query_ball_point((start + end) / 2, length / 2 + tolerance)
    on: dict[tuple[int, int], list[int]] = {}
    off = 0.0
    for (a, b), long, found in zip(border.tolist(), length.tolist(), near, strict=True):
        others = among[[i for i in found if among[i] not in (a, b)]]
        if not len(others) or long <= 2 * tolerance:
            continue
        along = (vertices[b] - vertices[a]) / long
        way = vertices[others] - vertices[a]
        s = way @ along
        aside = np.linalg.norm(way - s[:, None] * along, axis=1)
        inside = (aside <= tolerance) & (s > tolerance) & (s < long - tolerance)
        if inside.any():
            on[a, b] = others[inside][np.argsort(s[inside])].tolist()
            off = max(off, float(aside[inside].max()))
    if not on:
        return vertices, faces, 0, 0.0
    kept = np.ones(len(faces), bool)
    pieces = []
    for i, corners in enumerate(faces.tolist()):
        polygon: list[int] = []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            chain = on.get((min(a, b), max(a, b)), [])
            polygon += [a, *(chain if a < b else chain[::-1])]
        if len(polygon) > 3 and len(set(polygon)) == len(polygon):
            kept[i] = False
            pieces.append(triangulated(vertices, [polygon]))
    cut = np.concatenate([faces[kept], *pieces])
    return vertices, without_slivers(cut), sum(map(len, on.values())), off
