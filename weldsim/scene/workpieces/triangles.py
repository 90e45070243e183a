"""Distances, rays and columns of triangle meshes in double precision, by plain geometry."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

CHUNK = 2_000_000  # point-triangle pairs at a time


def distance_to_faces(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], points: Float[ndarray, "n 3"]
) -> Float[ndarray, "n"]:
    """Distance [m] of each point (n, 3) from the nearest of the triangles."""
    step = max(1, CHUNK // max(1, len(faces)))
    return np.concatenate([_distance(vertices[faces], points[i : i + step]) for i in range(0, len(points), step)])


def _distance(corners: Float[ndarray, "f 3 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
    a, normal = corners[:, 0], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    flat = length > 1e-18
    normal = normal / np.where(flat, length, 1.0)[:, None]
    to = points[:, None] - a
    height = np.einsum("pfi,fi->pf", to, normal)
    inside = np.broadcast_to(flat, height.shape).copy()
    edges = np.full(height.shape, np.inf)
    for i in range(3):
        start, edge = corners[:, i], corners[:, (i + 1) % 3] - corners[:, i]
        from_start = points[:, None] - start
        inside &= np.einsum("pfi,fi->pf", from_start, np.cross(normal, edge)) >= 0
        share = np.einsum("pfi,fi->pf", from_start, edge) / np.maximum(np.einsum("fi,fi->f", edge, edge), 1e-30)
        nearest = start + np.clip(share, 0, 1)[..., None] * edge
        edges = np.minimum(edges, np.linalg.norm(points[:, None] - nearest, axis=2))
    return np.where(inside, np.abs(height), edges).min(axis=1)


def ray_lengths(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]
) -> Float[ndarray, "n"]:
    """Distance [m] along each ray (n, 3) to the first triangle it meets; infinite where it meets none."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    edge_1, edge_2 = b - a, c - a
    lengths = []
    for origin, direction in zip(origins, directions, strict=True):
        p = np.cross(direction, edge_2)
        determinant = np.einsum("fi,fi->f", edge_1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            to = origin - a
            u = np.einsum("fi,fi->f", to, p) / determinant
            q = np.cross(to, edge_1)
            v = q @ direction / determinant
            t = np.einsum("fi,fi->f", edge_2, q) / determinant
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        lengths.append(t[hit].min() if hit.any() else np.inf)
    return np.array(lengths)


def column_runs(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], x: float, y: Float[ndarray, "n"]
) -> list[tuple[int, float, float]]:
    """Where vertical lines at (x, y[i]) run inside a closed mesh: (i, lower end, upper end) [m] of each run.

    Lines that graze an edge, which cross an odd number of faces, are left out.
    """
    corners = vertices[faces]
    near = (corners[:, :, 0].min(axis=1) <= x) & (corners[:, :, 0].max(axis=1) >= x)
    a, b, c = (corners[near, i] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    sloped = np.abs(area) > 1e-18
    a, b, c, area = a[sloped], b[sloped], c[sloped], area[sloped]
    runs = []
    for i, at in enumerate(y):
        u = ((x - a[:, 0]) * (c[:, 1] - a[:, 1]) - (at - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
        v = ((b[:, 0] - a[:, 0]) * (at - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])) / area
        hit = (u >= 0) & (v >= 0) & (u + v <= 1)
        z = np.sort((a[:, 2] + u * (b[:, 2] - a[:, 2]) + v * (c[:, 2] - a[:, 2]))[hit])
        if len(z) % 2 == 0:
            runs += [(i, float(low), float(high)) for low, high in zip(z[::2], z[1::2], strict=True)]
    return runs
