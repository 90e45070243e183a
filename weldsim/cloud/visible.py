"""What a camera could see of a cloud that shows a part from all sides: a closed reconstruction, or points sampled from a drawing.

A depth camera's cloud has one surface in each direction of sight. Where much of a cloud has two, one behind the other, the
hidden one would be averaged with the other; so it is left out. Without a viewpoint, both sides of the part are offered.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.frames import unit
from weldsim.records import PointCloud

SAMPLE = 40_000  # points that tell whether there are two surfaces
WIDTH = 2.0  # of a cell, in spacings of the points
GAP = 0.003  # [m] without points between two surfaces; sound metal under a groove is thicker
STEEPEST = 2.5  # rise over run of a wall that is still part of the surface it belongs to
SHARE = 0.5  # of the cells that must show two surfaces: one view of a scene has 0.04, a whole part 0.9
FEWEST = 4  # points in a cell that can show two


@dataclass(frozen=True, eq=False)
class Side:
    """One side of a cloud.

    Attributes:
        cloud: the points that can be seen from there.
        note: what was left out, for people; empty where nothing was.
    """

    cloud: PointCloud
    note: str = ""


def sides(cloud: PointCloud) -> tuple[Side, ...]:
    """The cloud as it can be seen from its viewpoint; without one from either side, the upper one first.

    A cloud that has its pixels, or several views, or one surface only, is returned as it is.
    """
    if cloud.pixel is not None or len(cloud.viewpoints) > 1 or len(cloud) < 2 * FEWEST:
        return (Side(cloud),)
    sample = cloud.points[:: max(1, len(cloud) // SAMPLE)]
    if len(cloud.viewpoints) == 1:
        if not _has_two(*_seen_from(sample, cloud.viewpoints[0])):
            return (Side(cloud),)
        kept = _front(*_seen_from(cloud.points, cloud.viewpoints[0]))
        behind = int((~kept).sum())
        note = (
            f"{behind} of {len(cloud)} points {'lies' if behind == 1 else 'lie'} behind others as seen from the viewpoint: left out"
        )
        return (Side(cloud.select(kept), note),)
    up = _thinnest(sample)
    if not _has_two(*_along(sample, up)):
        return (Side(cloud),)
    found = []
    for outward, name in ((up, "upper"), (-up, "lower")):
        kept = _front(*_along(cloud.points, outward))
        note = (
            f"the cloud shows a part from both sides: {int(kept.sum())} of {len(cloud)} points, of its {name} side, were searched"
        )
        facing = np.broadcast_to(outward, (int(kept.sum()), 3))
        found.append(Side(replace(cloud.select(kept), normals=facing), note))
    return tuple(found)


def _seen_from(points: Float[ndarray, "n 3"], viewpoint: Float[ndarray, "3"]) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n"]]:
    """Where points stand in a camera's image, in metres at their mean distance, and how far they are [m]; behind it, infinitely."""
    forward = unit(points.mean(axis=0) - viewpoint)
    across = unit(np.cross(forward, np.eye(3)[np.abs(forward).argmin()]))
    local = points - viewpoint
    depth = local @ forward
    before = depth > 1e-3
    scale = float(np.median(depth[before])) / np.where(before, depth, np.inf) if before.any() else np.zeros(len(depth))
    place = np.stack([local @ across, local @ np.cross(forward, across)], axis=1) * scale[:, None]
    return place, np.where(before, np.linalg.norm(local, axis=1), np.inf)


def _along(points: Float[ndarray, "n 3"], outward: Float[ndarray, "3"]) -> tuple[Float[ndarray, "n 2"], Float[ndarray, "n"]]:
    """The same for a camera infinitely far away in the direction `outward`; distances are from the outermost point [m]."""
    across = unit(np.cross(outward, np.eye(3)[np.abs(outward).argmin()]))
    depth = -(points @ outward)
    return np.stack([points @ across, points @ np.cross(outward, across)], axis=1), depth - depth.min()


def _has_two(place: Float[ndarray, "n 2"], depth: Float[ndarray, "n"]) -> bool:
    """Whether much of what is seen is two surfaces, one behind the other."""
    place, depth = place[np.isfinite(depth)], depth[np.isfinite(depth)]
    if len(depth) < 2 * FEWEST:
        return False
    cell, size = _cells(place)
    order = np.lexsort((depth, cell))
    same = np.diff(cell[order]) == 0
    step = np.where(same, np.diff(depth[order]), 0.0)
    number = np.bincount(cell)
    full = number >= FEWEST
    two = np.zeros(len(number), bool)
    two[cell[order][1:][step > max(GAP, size)]] = True
    return bool(np.count_nonzero(two & full) > SHARE * max(1, np.count_nonzero(full)))


def _front(place: Float[ndarray, "n 2"], depth: Float[ndarray, "n"]) -> Bool[ndarray, "n"]:
    """Which points belong to the surface in front. In each cell it ends at the first gap, or where it would be too steep;
    where a cell holds none of it by chance, what shows through is left out by its neighbours."""
    near = np.flatnonzero(np.isfinite(depth))
    cell, size = _cells(place[near], shaped=True)
    order = np.lexsort((depth[near], cell))
    sorted_cell, sorted_depth = cell[order], depth[near][order]
    starts = np.flatnonzero(np.concatenate([[True], np.diff(sorted_cell) > 0]))
    which = np.cumsum(np.concatenate([[True], np.diff(sorted_cell) > 0])) - 1
    gap = np.concatenate([[False], (np.diff(sorted_depth) > GAP) & (np.diff(sorted_cell) == 0)])
    behind = np.cumsum(gap) - np.cumsum(gap)[starts][which] > 0
    first = sorted_depth[starts]
    steep = sorted_depth - first[which] > max(GAP, STEEPEST * size)
    through = _shows_through(first, sorted_cell[starts], max(GAP, STEEPEST * size))
    kept = np.zeros(len(depth), bool)
    kept[near[order]] = ~(behind | steep | through[which])
    return kept


def _shows_through(first: Float[ndarray, "k"], cell: Int[ndarray, "k"], step: float) -> Bool[ndarray, "k"]:
    """Which cells begin deeper than most of the eight around them, by more than a slope makes."""
    depth = dict(zip(cell.tolist(), first.tolist(), strict=True))
    stride = 1 << 20
    around = [dy * stride + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
    values = np.array([[depth.get(each + by, np.nan) for by in around] for each in cell.tolist()]).reshape(-1, 8)
    nearer = (values < first[:, None] - step).sum(axis=1)
    return nearer >= 5


def _cells(place: Float[ndarray, "n 2"], *, shaped: bool = False) -> tuple[Int[ndarray, "n"], float]:
    """The cell of each point, and the cells' size [m]; `shaped` cells are numbered row * 2^20 + column, others from 0."""
    low = place.min(axis=0)
    coarse = max(float(np.ptp(place, axis=0).max()) / 96, 1e-6)
    held = len(np.unique(np.floor((place - low) / coarse).astype(np.int64) @ np.array([1, 1 << 20])))
    size = max(WIDTH * float(np.sqrt(2 * held * coarse**2 / len(place))), 1e-5)
    cell = np.floor((place - low) / size).astype(np.int64) @ np.array([1, 1 << 20])
    return (cell if shaped else np.unique(cell, return_inverse=True)[1].ravel()), size


def _thinnest(points: Float[ndarray, "n 3"]) -> Float[ndarray, "3"]:
    """Direction in which points extend least, upwards."""
    offset = points - points.mean(axis=0)
    normal = np.linalg.eigh(offset.T @ offset)[1][:, 0]
    leading = normal[2] if abs(normal[2]) > 0.05 else -normal[1]
    return normal if leading >= 0 else -normal
