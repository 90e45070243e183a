"""Closed shells of triangles: faces turned to one winding, each body outward, hollows inward; or why that cannot be."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

_ASLANT = np.array([0.2163, 0.3817, 0.8986])  # a direction in which no part has edges


SHEET = 0.3  # of the edges with one face only: more than holes make


class Broken(ValueError):  # noqa: N818 - a reason, turned into SceneError by whoever knows the file
    """Why triangles are no closed surface, in one clause."""


@dataclass(frozen=True, eq=False)
class Shells:
    """Attributes:
    faces: (f, 3) as they were, some turned.
    notes: what was turned, one sentence each.
    """

    faces: Int[ndarray, "f 3"]
    notes: tuple[str, ...]


def outward(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Shells:
    """The faces of one or several closed bodies, each facing out of its material.

    Bodies may touch along edges. Within each the faces are given one winding, then the sign of its volume says which way they
    face; a shell inside another is a hollow of it and faces inward.

    Raises:
        Broken: a surface with an edge, or one of which no winding can be told (as of a Moebius strip).
    """
    body = _bodies(vertices, faces)
    _check_closed(vertices, faces, body)
    turned = _against(vertices, faces)
    wound = np.where(turned[:, None], faces[:, ::-1], faces)
    count = int(body.max()) + 1
    volume = np.array([_volume(vertices, wound[body == each]) for each in range(count)])
    wanted = np.where(_depth(vertices, faces, body, count) % 2 == 0, 1.0, -1.0)
    turned ^= (volume * wanted < 0)[body]
    share = np.bincount(body, weights=turned) / np.bincount(body)
    notes = []
    if few := int(np.count_nonzero(turned & (share < 1)[body])):
        verb = "was" if few == 1 else "were"
        notes.append(f"{few} of its {len(faces)} facets {verb} turned the wrong way: turned back")
    if whole := int(np.count_nonzero(share == 1)):
        notes.append("it was inside out: turned" if count == 1 else f"of its {count} bodies {whole} inside out: turned")
    return Shells(np.where(turned[:, None], faces[:, ::-1], faces), tuple(notes))


def _edges(faces: Int[ndarray, "f 3"]) -> tuple[Int[ndarray, "e"], Int[ndarray, "e"], Bool[ndarray, "e"]]:
    """For each side of each face, in order: which edge it is, its face, and whether it runs from the lower vertex to the higher."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, edge = np.unique(low * (int(faces.max()) + 1) + high, return_inverse=True)
    return edge.ravel(), np.repeat(np.arange(len(faces)), 3), start < end


def _neighbours(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> tuple[Int[ndarray, "p 2"], Bool[ndarray, "p"]]:
    """Pairs of faces that share an edge, and whether both run along it the same way, as only one of them should.

    Where bodies touch along an edge, it has more than two faces: each pair then bounds one wedge of material.
    """
    edge, face, forward = _edges(faces)
    order = np.argsort(edge, kind="stable")
    number = np.bincount(edge)
    start = np.concatenate([[0], np.cumsum(number)[:-1]])
    first = start[number == 2]
    sides = [np.stack([order[first], order[first + 1]], axis=1)]
    for at, many in zip(start[number > 2].tolist(), number[number > 2].tolist(), strict=True):
        sides.append(_wedges(vertices, faces, order[at : at + many], forward))
    pairs = np.concatenate(sides)
    return face[pairs], forward[pairs[:, 0]] == forward[pairs[:, 1]]


def _wedges(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], sides: Int[ndarray, "k"], forward: Bool[ndarray, "e"]
) -> Int[ndarray, "q 2"]:
    """Sides of faces about one edge, paired where material lies between; none where the faces' windings tell no such pairs.

    Seen along the edge, material begins at a face that runs backward along it and ends at the next that runs forward.
    """
    side, corner = sides // 3, sides % 3
    a, b, c = (vertices[faces[side, (corner + i) % 3]] for i in range(3))
    ahead = forward[sides]
    along = (b[0] - a[0]) * (1.0 if ahead[0] else -1.0)
    along = along / max(float(np.linalg.norm(along)), 1e-300)
    into = c - a - ((c - a) @ along)[:, None] * along
    across = into[0] / max(float(np.linalg.norm(into[0])), 1e-300)
    angle = np.round(np.arctan2(into @ np.cross(along, across), into @ across), 6) % np.round(2 * np.pi, 6)
    order = np.lexsort((~ahead, angle))  # of two faces at one angle the wedge that ends comes first
    order = np.roll(order, -int(np.flatnonzero(~ahead[order])[0])) if not ahead.all() else order
    begins, ends = order[::2], order[1::2]
    if len(order) % 2 or ahead[begins].any() or not ahead[ends].all():
        return np.zeros((0, 2), np.int64)
    return np.stack([sides[begins], sides[ends]], axis=1)


def _bodies(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Int[ndarray, "f"]:
    """Which body each face belongs to: those joined across edges."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    pairs, _ = _neighbours(vertices, faces)
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _check_closed(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], body: Int[ndarray, "f"]) -> None:
    """Raises Broken where an edge of a body has not two of its faces."""
    edge, face, _ = _edges(faces)
    key = edge * (int(body.max()) + 1) + body[face]
    _, at, number = np.unique(key, return_index=True, return_counts=True)
    wrong = number != 2
    if not wrong.any():
        return
    side = int(at[wrong][0])
    x, y, z = vertices[faces[side // 3]][[side % 3, (side + 1) % 3]].mean(axis=0)
    single = int((number == 1).sum())
    what = f"{single} have one face only" if single else f"{int(wrong.sum())} have more than two faces of one body"
    remedy = "close it (fill holes) where it was made" if single else "leave out what lies inside it or twice where it was made"
    if single > SHEET * len(number):
        remedy = "a surface without thickness is no part: export it as a solid"
    raise Broken(f"is not closed: of its {len(number)} edges {what}, the first at ({x:.6g}, {y:.6g}, {z:.6g}); {remedy}")


def _against(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> Bool[ndarray, "f"]:
    """Which faces to turn so that all of a body have one winding, whichever. Raises Broken."""
    pairs, same = _neighbours(vertices, faces)
    turned = np.zeros(len(faces), bool)
    if not same.any():
        return turned
    beside: list[list[tuple[int, bool]]] = [[] for _ in faces]
    for (a, b), odd in zip(pairs.tolist(), same.tolist(), strict=True):
        beside[a].append((b, odd))
        beside[b].append((a, odd))
    known = np.zeros(len(faces), bool)
    for seed in range(len(faces)):
        if known[seed]:
            continue
        known[seed], waiting = True, deque([seed])
        while waiting:
            a = waiting.popleft()
            for b, odd in beside[a]:
                wanted = bool(turned[a]) != odd
                if not known[b]:
                    known[b], turned[b] = True, wanted
                    waiting.append(b)
                elif turned[b] != wanted:
                    raise Broken("has one side only, like a Moebius strip: no side of it is the outer one; close it as a solid")
    return turned


def _volume(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> float:
    """Enclosed volume, negative where the faces face inward."""
    a, b, c = (vertices[faces[:, i]] - vertices[faces[0, 0]] for i in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c))) / 6


def _depth(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], body: Int[ndarray, "f"], count: int) -> Int[ndarray, "k"]:
    """In how many other bodies each one lies whole."""
    depth = np.zeros(count, np.int64)
    if count == 1:
        return depth
    parts = [faces[body == each] for each in range(count)]
    boxes = [(vertices[part].min(axis=(0, 1)), vertices[part].max(axis=(0, 1))) for part in parts]
    for inner in range(count):
        for outer in range(count):
            (low, high), (least, most) = boxes[inner], boxes[outer]
            if inner != outer and (low > least).all() and (high < most).all():
                looks = vertices[np.unique(parts[inner])[:: max(1, len(parts[inner]) // 32)]]
                depth[inner] += all(_holds(vertices, parts[outer], point) for point in looks)
    return depth


def _holds(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], point: Float[ndarray, "3"]) -> bool:
    """Whether a point lies inside a shell: a ray from it crosses the shell an odd number of times."""
    a = vertices[faces[:, 0]]
    edge_1, edge_2, to = vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a, point - a
    p = np.cross(_ASLANT, edge_2)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = np.einsum("fi,fi->f", edge_1, p)
        u = np.einsum("fi,fi->f", to, p) / determinant
        q = np.cross(to, edge_1)
        v, t = q @ _ASLANT / determinant, np.einsum("fi,fi->f", edge_2, q) / determinant
        return int(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)).sum()) % 2 == 1
