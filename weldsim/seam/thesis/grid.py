"""CellGrid: points sorted into cubic cells, so that all neighbours within a radius lie in a few contiguous runs."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

MAX_CELLS = 1 << 22  # cells grow beyond half the radius rather than fill memory when a cloud is wide
THREADS = 2
BLOCKS = 16  # pieces of work: enough for threads to finish together
FEW = 4096  # points: threads take longer to start than these take


def threads() -> int:
    """How many threads share the work: as many as native libraries are allowed (OMP_NUM_THREADS), `THREADS` at most."""
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    return min(THREADS, int(allowed)) if allowed.isdecimal() and int(allowed) > 0 else THREADS


@dataclass(frozen=True, eq=False)
class CellGrid:
    """Points in cell order.

    Attributes:
        points: (n, 3) [m], sorted by cell, x fastest.  order: (n,) their indices in the cloud as given.
        start: (cells + 1,) first point of each cell.  shape: cells along x, y, z.
        origin: lower corner [m].  cell: edge of a cell [m].  radius: of the neighbourhoods [m].
        reach: cells to look at each way.
    """

    points: Float[ndarray, "n 3"]
    order: Int[ndarray, "n"]
    start: Int[ndarray, "k"]
    shape: Int[ndarray, "3"]
    origin: Float[ndarray, "3"]
    cell: float
    radius: float
    reach: int

    @classmethod
    def build(cls, points: Float[ndarray, "n 3"], radius: float) -> "CellGrid":
        """The grid of a cloud of at least one point, for neighbourhoods of `radius` [m]."""
        origin, extent = points.min(axis=0), np.ptp(points, axis=0)
        cell = radius / 2
        while np.prod(extent // cell + 1) > MAX_CELLS:
            cell *= 1.25
        shape = (extent // cell).astype(np.int64) + 1
        index = np.minimum(((points - origin) / cell).astype(np.int64), shape - 1)
        key = (index[:, 2] * shape[1] + index[:, 1]) * shape[0] + index[:, 0]
        order = np.argsort(key, kind="stable")
        start = np.concatenate([[0], np.cumsum(np.bincount(key, minlength=int(np.prod(shape))))])
        reach = int(np.ceil(radius / cell - 1e-9))
        return cls(np.ascontiguousarray(points[order]), order, start, shape, origin, float(cell), radius, reach)

    def run(self, kernel: Callable[..., None], *arrays: Any) -> None:
        """Call `kernel(first, last, *grid, *arrays)` over all points in blocks, on threads (kernels release the GIL).
        `arrays` are in cell order and outputs are written in place, so the result does not depend on the threads."""
        n, workers = len(self.points), threads()
        grid = (self.points, self.start, self.shape, self.origin, 1.0 / self.cell, self.reach, self.radius**2)
        if n <= FEW or workers == 1:
            kernel(0, n, *grid, *arrays)
            return
        edges = np.linspace(0, n, BLOCKS + 1).astype(np.int64)
        kernel(0, 0, *grid, *arrays)  # compiled once, before the threads race to do it
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(lambda i: kernel(edges[i], edges[i + 1], *grid, *arrays), range(BLOCKS)))

    def unsort(self, values: Float[ndarray, "n *rest"]) -> Float[ndarray, "n *rest"]:
        """Values in cell order put back into the cloud's order."""
        out = np.empty_like(values)
        out[self.order] = values
        return out
