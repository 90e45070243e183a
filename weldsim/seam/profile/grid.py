"""A strip averaged into cells of station by lateral position: the straightened picture of a groove."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.curves import interpolate
from weldsim.seam.profile.parent import Parent
from weldsim.seam.profile.rail import Rail, Strip

DX = 0.0005  # [m] lateral size of a cell
DENSE = 0.25  # share of cells with points from which on a cloud is dense
WIDEST = 4.0  # times as many stations as in a dense cloud are looked at together, at most


@dataclass(frozen=True, eq=False)
class Grid:
    """Attributes:
    x: (w,) lateral centre of each column [m].
    depth: (m, w) mean apparent depth below the parent surface [m], NaN where empty.
    at: (m, w) mean lateral place of the points in each cell [m], its centre where empty. Along a groove that runs with the
        image's rows or columns they lie at one and the same place in each column's cells: on a wall, that is another depth
        than the centre's, and no number of stations evens it out.
    count: (m, w) points in each cell.
    shear: (m,) lateral drift of the sight line for each metre inward.
    sight: (m, 3) mean direction of the sight lines, in the cloud's frame; straight down where the viewpoint is unknown.
    step: between stations [m].
    above: height of the viewpoint over the parent surface [m]; infinity where unknown.
    views: the cells of each view alone; none where all are of one view, or nobody knows of which. A point below the parent
        surface lies where its sight line meets it, which is another place in each view: taken together, a V has a flat bottom.
    """

    x: Float[ndarray, "w"]
    depth: Float[ndarray, "m w"]
    at: Float[ndarray, "m w"]
    count: Float[ndarray, "m w"]
    shear: Float[ndarray, "m"]
    sight: Float[ndarray, "m 3"]
    step: float
    above: float
    views: "tuple[Grid, ...]" = ()

    @property
    def sparsity(self) -> float:
        """How many times as many stations must be looked at together as in a dense cloud to hold as many points, 1 to WIDEST."""
        share = float(np.quantile(np.isfinite(self.depth).mean(axis=1), 0.6))
        return float(np.clip(DENSE / max(share, 1e-6), 1.0, WIDEST))

    def centred(self) -> "Grid":
        """The same with every cell taken to be seen at its middle."""
        views = tuple(view.centred() for view in self.views)
        return replace(self, at=np.tile(self.x, (len(self.depth), 1)), views=views)

    def filled(self) -> Float[ndarray, "m w"]:
        """Depths with empty cells taken from the stations around, where the cloud is sparse, then from their neighbours
        along each row; rows without any are 0."""
        depth = self.depth
        reach = round(2 * (self.sparsity - 1))
        if reach > 0:
            kernel = np.ones((2 * reach + 1, 1))
            total = cv2.filter2D(np.where(np.isfinite(depth), depth * self.count, 0.0), -1, kernel, borderType=cv2.BORDER_CONSTANT)
            number = cv2.filter2D(self.count, -1, kernel, borderType=cv2.BORDER_CONSTANT)
            around = np.divide(total, number, out=np.full(depth.shape, np.nan), where=number > 0.5)
            depth = np.where(np.isfinite(depth), depth, around)
        out = np.zeros_like(depth)
        for row, values in enumerate(depth):
            known = np.isfinite(values)
            if known.any():
                out[row] = np.interp(self.x, self.x[known], values[known])
        return out


def ray_coordinates(strip: Strip, parent: Parent) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"], Float[ndarray, "k"]]:
    """Where each point's sight line meets the parent surface (s, x) [m], and its apparent depth [m] in inverse depth."""
    station = strip.station
    surface = parent.a[station] + parent.b[station] * strip.x + parent.c * strip.x**2
    below = surface - strip.h
    s = strip.s - below * strip.slope[:, 0]
    x = strip.x - below * strip.slope[:, 1]
    with np.errstate(invalid="ignore"):
        scale = np.where(np.isfinite(strip.above), strip.above / np.maximum(strip.above + below, 1e-3), 1.0)
    return s, x, below * scale


def make_grid(rail: Rail, strip: Strip, parent: Parent, half: float, views: Sequence[Int[ndarray, "_"]] = ()) -> Grid:
    """The grid of a strip out to |x| < half [m].

    Args:
        views: which of its points each view shows.
    """
    s, x, depth = ray_coordinates(strip, parent)
    m, width = len(rail), int(np.ceil(2 * half / DX))
    row = np.rint(s / rail.step).astype(int)
    column = np.floor((x + half) / DX).astype(int)
    inside = (row >= 0) & (row < m) & (column >= 0) & (column < width) & (depth > -0.02)
    index = row[inside] * width + column[inside]
    count = np.bincount(index, minlength=m * width).astype(float)
    total = np.bincount(index, weights=depth[inside], minlength=m * width)
    mean = np.divide(total, count, out=np.full(m * width, np.nan), where=count > 0)
    centres = (np.arange(width) + 0.5) * DX - half
    at = np.bincount(index, weights=x[inside] - centres[column[inside]], minlength=m * width) / np.maximum(count, 1)
    at = at.reshape(m, width) + centres
    near = np.abs(strip.x) < half
    number = np.bincount(strip.station[near], minlength=m)
    drift = np.stack([np.bincount(strip.station[near], weights=strip.slope[near, k], minlength=m) for k in (0, 1)], axis=1)
    known = number > 0
    above = float(np.median(strip.above[near])) if near.any() else float("inf")
    every = np.arange(m, dtype=float)
    drift = interpolate(every[known], drift[known] / number[known, None], every) if known.any() else np.zeros((m, 2))
    sight = drift[:, :1] * rail.t + drift[:, 1:] * rail.e - rail.n
    apart = tuple(make_grid(rail, strip.select(view), parent, half) for view in views)
    return Grid(centres, mean.reshape(m, width), at, count.reshape(m, width), drift[:, 1], sight, rail.step, above, apart)
