"""Which ways the surface of a cloud without viewpoints faces."""

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.frames import unit
from weldsim.records import PointCloud

PATCH = 0.008  # [m] side of the cubes whose points tell a normal
SAMPLE = 60_000  # points are enough to tell
SEEN = 0.64  # cosine: a surface turned further from a chart's direction than this wants a chart of its own
ALIKE = 0.9  # cosine between the normals of one direction
SHARE = 0.08  # of the patches that a direction must have
MOST = 5  # further directions
OPPOSED = -0.35  # cosine to the main direction, under which a surface would be looked at from behind: a ridge is a valley there
LAYER = 0.025  # [m] below the outermost point of a cell is still the same surface: deeper than a groove
MOST_CUBES = 4_000_000  # are numbered by counting, more by sorting
CELL = 0.003  # [m] of such a cell


def facing_directions(cloud: PointCloud, main: Float[ndarray, "3"]) -> list[Float[ndarray, "3"]]:
    """Outward directions (3,) unit, besides `main`, that much of the surface faces and `main` does not see well.

    Normals without a sign are turned away from the middle of the cloud; where patches of one direction lie on both sides
    of it, as on a box, both ways count.
    """
    centres, normals, signed = _patches(cloud)
    if len(centres) < 50:
        return []
    middle = centres.mean(axis=0)
    left = np.abs(normals @ main) < SEEN
    found: list[Float[ndarray, "3"]] = []
    while np.count_nonzero(left) > SHARE * len(centres) and len(found) < MOST:
        rest = normals[left]
        among: Float[ndarray, "j 3"] = rest[:: max(1, len(rest) // 64)]
        axis = among[int(np.count_nonzero(np.abs(rest @ among.T) > ALIKE, axis=0).argmax())]
        alike = np.abs(normals @ axis) > ALIKE
        axis = unit((normals[alike] * np.sign(normals[alike] @ axis)[:, None]).mean(axis=0))
        left &= np.abs(normals @ axis) < SEEN
        if np.count_nonzero(alike) < SHARE * len(centres):
            continue
        out = normals[alike] @ axis if signed else (centres[alike] - middle) @ axis
        found += [way * axis for way in (1.0, -1.0) if np.mean(way * out > 0) > 0.25 and way * float(axis @ main) > OPPOSED]
    return found[:MOST]


def _patches(cloud: PointCloud) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"], bool]:
    """Centres [m] and normals of the flat patches of a cloud, and whether the normals' signs are known."""
    keep = slice(None, None, max(1, len(cloud) // SAMPLE))
    points = cloud.points[keep]
    size = max(PATCH, 3.0 * _spacing(points))
    key, cubes = _cubes(points, size)
    if cubes <= MOST_CUBES:
        held = np.bincount(key, minlength=cubes)
        which, number = (np.cumsum(held > 0) - 1)[key], held[held > 0]
    else:
        _, which, number = np.unique(key, return_inverse=True, return_counts=True)

    def mean(values: Float[ndarray, "n"]) -> Float[ndarray, "k"]:
        return np.bincount(which, weights=values) / number

    columns = np.ascontiguousarray(points.T)
    centres = np.stack([mean(column) for column in columns], axis=1)
    away = [column - centre[which] for column, centre in zip(columns, centres.T, strict=True)]
    spread = np.empty((len(number), 3, 3))
    for i in range(3):
        for j in range(i, 3):
            spread[:, i, j] = spread[:, j, i] = mean(away[i] * away[j])
    values, vectors = np.linalg.eigh(spread)
    flat = (number >= 6) & (values[:, 0] < 0.1 * values[:, 1])
    normals = vectors[:, :, 0]
    if cloud.normals is not None:
        known = np.stack([mean(column) for column in cloud.normals[keep].T], axis=1)
        normals = normals * np.where(np.einsum("ij,ij->i", normals, known) < 0, -1.0, 1.0)[:, None]
    return centres[flat], normals[flat], cloud.normals is not None


def _cubes(points: Float[ndarray, "n 3"], size: float) -> tuple[Int[ndarray, "n"], int]:
    """The number of the cube of edge `size` [m] in which each point lies, and how many cubes there are."""
    key, cubes = np.zeros(len(points), np.int64), 1
    for column in points.T:
        place = ((column - column.min()) / size).astype(np.int64)
        count = int(place.max()) + 1
        key, cubes = key * count + place, cubes * count
    return key, cubes


def _spacing(points: Float[ndarray, "n 3"]) -> float:
    """Usual distance between points [m], from the cubes of a coarse grid that hold any."""
    size = max(max(float(np.ptp(column)) for column in points.T) / 64, 1e-6)
    key, cubes = _cubes(points, size)
    held = np.count_nonzero(np.bincount(key, minlength=cubes))
    return float(np.sqrt(held * size**2 / len(points)))


def front_layer(points: Float[ndarray, "n 3"], outward: Float[ndarray, "3"]) -> Int[ndarray, "m"]:
    """Indices of the points that are not hidden behind others, looked at against `outward`."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(outward[0]) < 0.8 else np.array([0.0, 1.0, 0.0])
    across = unit(np.cross(outward, helper))
    place = np.stack([points @ across, points @ np.cross(outward, across)], axis=1)
    size = max(CELL, 1.5 * _spacing(points))
    cell = np.floor((place - place.min(axis=0)) / size).astype(np.int64)
    key = cell[:, 0] * (cell[:, 1].max() + 1) + cell[:, 1]
    height = points @ outward
    top = np.full(int(key.max()) + 1, -np.inf)
    np.maximum.at(top, key, height)
    return np.flatnonzero(height > top[key] - LAYER)
