"""Disparity noise as a sum of Gaussian fields, each alike over its own lengths along rows and columns.

White numbers on a coarse grid are spread out by Gaussian weights, tap by tap with plain multiplications and additions, which
round alike on every processor; a long field costs no more than a short one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from numpy import ndarray
from numpy.random import Generator

from weldsim.quantity import Pixel, require_within

REACH = 3.5  # deviations of the weights at which they are cut off, where they have fallen to 0.002
RANGES = {"sigma": (0.0, 10.0), "along_rows": (0.1, 500.0), "along_columns": (0.1, 500.0)}


@dataclass(frozen=True, kw_only=True)
class NoiseField:
    """One Gaussian field of disparity noise."""

    sigma: Pixel
    """Standard deviation."""
    along_rows: Pixel
    """Distance along a row at which the correlation falls to 1/e."""
    along_columns: Pixel
    """Distance along a column at which the correlation falls to 1/e."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "noise")


def total_sigma(fields: Sequence[NoiseField]) -> float:
    """Standard deviation of the sum of independent fields [px]."""
    return math.hypot(*(field.sigma for field in fields))


def disparity_noise(
    fields: Sequence[NoiseField], shape: tuple[int, int], changing: float, still: Generator, fresh: Generator
) -> Float32[ndarray, "h w"]:
    """The sum of the fields [px]: a share `changing` of its standard deviation follows `fresh`, the rest `still`."""
    total = np.zeros(shape, np.float32)
    for field in fields:
        down, along = _weights(shape[0], field.along_columns), _weights(shape[1], field.along_rows)
        grid = (down.nodes, along.nodes)
        white = np.float32(math.sqrt(1 - changing**2)) * still.standard_normal(grid, dtype=np.float32)
        if changing:
            white += np.float32(changing) * fresh.standard_normal(grid, dtype=np.float32)
        white *= np.float32(field.sigma)
        total += _spread(np.ascontiguousarray(_spread(white, down).T), along).T
    return total


@dataclass(frozen=True, eq=False)
class _Weights:
    """How pixels on a line depend on nodes `step` px apart: pixel k * step + p on nodes k to k + taps by `table[p]`.

    The squares of each pixel's weights add to 1, so that its variance is that of a node.
    """

    size: int
    step: int
    table: Float32[ndarray, "step taps"]

    @property
    def blocks(self) -> int:
        """Blocks of `step` pixels, the last perhaps incomplete."""
        return -(-self.size // self.step)

    @property
    def nodes(self) -> int:
        return self.blocks + self.table.shape[1] - 1


def _weights(size: int, length: float) -> _Weights:
    """For `size` pixels whose correlation falls to 1/e at `length`.

    Weights of deviation s give a correlation of exp(-r^2 / 4 s^2), so s is half the length. Nodes no farther apart than s
    make that hold to 1e-3, wherever the pixel lies between them; below a length of 2 px they are the pixels, and it holds roughly.
    """
    deviation = length / 2
    step = max(1, int(deviation))
    before = math.ceil(REACH * deviation / step)
    offsets = np.arange(step)[:, None] - step * np.arange(-before, before + 2)[None, :]
    table = np.exp(-0.5 * (offsets / deviation) ** 2)
    return _Weights(size, step, (table / np.linalg.norm(table, axis=1, keepdims=True)).astype(np.float32))


def _spread(white: Float32[ndarray, "nodes m"], weights: _Weights) -> Float32[ndarray, "size m"]:
    """Pixels from nodes, along the first axis."""
    columns = white.shape[1]
    out = np.empty((weights.blocks, weights.step, columns), np.float32)
    product = np.empty((weights.blocks, columns), np.float32)
    for phase, row in enumerate(weights.table):
        into = out[:, phase]
        np.multiply(white[: weights.blocks], row[0], out=into)
        for tap in range(1, len(row)):
            np.multiply(white[tap : tap + weights.blocks], row[tap], out=product)
            into += product
    return out.reshape(-1, columns)[: weights.size]
