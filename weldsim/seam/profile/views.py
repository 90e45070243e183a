"""A groove's mean sections, one for each direction of sight, and how their noise hangs together."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

SAME_VIEW = 2e-4  # [m] blocks whose bottoms the sight line displaces alike within this are averaged
MOST_VIEWS = 5
FEWEST_BLOCKS = 4  # in a view: a median of fewer is no robust one
REACHES = (0.001, 0.002, 0.003, 0.004, 0.0055, 0.0075, 0.0105)  # [m] correlation lengths tried for the noise
SHARPNESS = 2.0  # with which a worse correlation length counts less
USUAL_REACH = 0.0035  # [m] where there is too little to tell
QUIETEST = (1e-4, 2e-4)  # [m] least standard deviation of a cell: of blocks that agree to that, and of any others
AGREEING = 0.9  # of the cells in the groove: where a view ends, a wall may be missing
INSIDE = 0.1  # of the groove's depth
WHITE = 0.2  # of the noise's variance, at least, is taken as independent from cell to cell: cells are no exact means
PARENT = 0.4  # error of the parent surface, level and tilt, over the noise of a cell


@dataclass(frozen=True, eq=False)
class Blocks:
    """Cells of a strip averaged over blocks of stations.

    Attributes:
        x: (w,) centre of each column of cells [m].  at: (b, w) mean lateral place of the points in each cell [m].
        depth: (b, w) apparent [m].  number: (b, w) stations with data in each cell, of `full`; 0 = empty.
        shear: (b,) how far the sight line drifts to the left for each metre inward.
    """

    x: Float[ndarray, "w"]
    at: Float[ndarray, "b w"]
    depth: Float[ndarray, "b w"]
    number: Float[ndarray, "b w"]
    shear: Float[ndarray, "b"]
    full: int

    def centred(self) -> "Blocks":
        """The same with every cell taken to be seen at its middle."""
        return replace(self, at=np.tile(self.x, (len(self.depth), 1)))


@dataclass(frozen=True, eq=False)
class Views:
    """Blocks gathered into a few mean sections.

    Attributes:
        shear: (g,).  depth, weight: (g, w) robust mean [m] and inverse variance [1/m^2], 0 where empty.
        at: (g, w) mean lateral place of the points behind each mean [m].
        of: (b,) view of each block.  each: (b, w) the part of each cell in that weight.
        white: (w, w) maps cells over their deviation to independent numbers of unit variance; (0, 0) where they are taken to
            be that.
        quiet: whether the blocks agree to within QUIETEST.
    """

    shear: Float[ndarray, "g"]
    at: Float[ndarray, "g w"]
    depth: Float[ndarray, "g w"]
    weight: Float[ndarray, "g w"]
    of: Int[ndarray, "b"]
    each: Float[ndarray, "b w"]
    white: Float[ndarray, "q q"]
    quiet: bool


def gather(blocks: Blocks, depth: float, noise: float) -> Views:
    """The robust mean section for each direction of sight.

    Args:
        depth: of the groove, roughly [m].  noise: the least standard deviation of a cell [m].
    """
    of, known, middle = _grouped(blocks, depth)
    seen = np.where(known, blocks.depth, np.nan)
    off = np.nan_to_num(seen - middle[of])
    least = _least(off, known)
    deviation = deviation_across(np.where(known, np.abs(off), np.nan), max(noise, least))
    tame = 1 / np.maximum(np.abs(off) / (2.5 * deviation), 1.0)
    each = known * blocks.number / blocks.full * tame / deviation**2
    weight, total, place = (np.zeros_like(middle) for _ in range(3))
    np.add.at(weight, of, each)
    np.add.at(total, of, each * np.nan_to_num(seen))
    np.add.at(place, of, each * (blocks.at - blocks.x))
    shear = np.bincount(of, weights=blocks.shear) / np.bincount(of)
    white = np.linalg.inv(np.linalg.cholesky(correlation_across(off * tame / deviation, known, blocks.x)))
    some = np.maximum(weight, 1e-30)
    return Views(shear, blocks.x + place / some, total / some, weight, of, each, white, _agree(blocks, depth, known, middle[of]))


def agree(blocks: Blocks, depth: float) -> bool:
    """Whether the blocks show one section to within QUIETEST, but for a few cells: an exact sensor's, not a noisy camera's.

    Args:
        depth: of the groove, roughly [m].
    """
    of, known, middle = _grouped(blocks, depth)
    return _agree(blocks, depth, known, middle[of])


def _agree(blocks: Blocks, depth: float, known: Bool[ndarray, "b w"], middle: Float[ndarray, "b w"]) -> bool:
    """Whether they do so, with the known cells and each block's median section [m] as `_grouped` says them."""
    if len(blocks.depth) < FEWEST_BLOCKS:
        return False
    with np.errstate(invalid="ignore"):
        inside = known & (middle > INSIDE * depth)  # a camera that counts in steps shows plates without noise, but no groove
    off = np.sort(np.abs(blocks.depth - middle)[inside])
    most = off[: int(np.ceil(AGREEING * len(off)))]
    return len(most) > 0 and float(np.sqrt((most * most).mean())) < QUIETEST[1]


def _grouped(blocks: Blocks, depth: float) -> tuple[Int[ndarray, "b"], Bool[ndarray, "b w"], Float[ndarray, "g w"]]:
    """View of each block, which cells may show the groove, and each view's median section [m]."""
    count = len(blocks.shear)
    spread = float(np.ptp(blocks.shear))
    groups = int(np.clip(np.ceil(spread * depth / SAME_VIEW), 1, min(MOST_VIEWS, max(count // FEWEST_BLOCKS, 1))))
    of = np.empty(count, np.int64)
    of[np.argsort(blocks.shear, kind="stable")] = np.arange(count) * groups // count
    # Far below the bottom or above the lips there is no groove but the table past the plate's edge, or a clamp.
    known = (blocks.number > 0) & (blocks.depth < 1.5 * depth + 0.003) & (blocks.depth > -0.004)
    seen = np.where(known, blocks.depth, np.nan)
    return of, known, np.stack([_median(seen[of == g]) for g in range(groups)])


def _median(values: Float[ndarray, "b w"]) -> Float[ndarray, "w"]:
    """Median of the known values of each column; NaN where there is none."""
    order = np.sort(values, axis=0)
    last = np.maximum(np.isfinite(values).sum(axis=0) - 1, 0)
    column = np.arange(values.shape[1])
    return 0.5 * (order[last // 2, column] + order[(last + 1) // 2, column])


def _least(off: Float[ndarray, "b w"], known: Bool[ndarray, "b w"]) -> float:
    """The least standard deviation of a cell [m], as the blocks' rms distance from their mean tells: a camera that counts in
    steps shows plates without noise, but no groove."""
    if len(off) < FEWEST_BLOCKS:
        return QUIETEST[1]
    return float(np.clip(np.sqrt((off * off).sum() / max(np.count_nonzero(known), 1)), *QUIETEST))


def deviation_across(off: Float[ndarray, "b w"], noise: float) -> Float[ndarray, "w"]:
    """Standard deviation of a cell [m] in each column, robust, evened out over 3.5 mm."""
    spread = 1.4826 * _median(off)
    spread = np.where(np.isfinite(spread), spread, noise)
    return np.maximum(np.convolve(np.pad(spread, 3, mode="edge"), np.ones(7) / 7, mode="valid"), noise)


def correlation_across(off: Float[ndarray, "b w"], known: Bool[ndarray, "b w"], x: Float[ndarray, "w"]) -> Float[ndarray, "w w"]:
    """Covariance of cells across the seam, over their variances: of the noise, as seen, and of the parent surface.

    The noise is part white, part with correlation exp(-(distance / length)^2).
    """
    w = len(x)
    lags = np.arange(1, min(24, w // 2))
    pairs = np.array([max(np.count_nonzero(known[:, :-k] & known[:, k:]), 1) for k in lags])
    seen = np.array([(off[:, :-k] * off[:, k:]).sum() for k in lags]) / pairs
    power = (off * off).sum() / max(np.count_nonzero(known), 1)
    apart = (x[:, None] - x[None, :]) ** 2
    reaches, shares, chance = np.array([USUAL_REACH]), np.array([1 - WHITE]), np.ones(1)
    if len(off) >= 4 and power > 0:
        reaches = np.array(REACHES)
        shapes = np.exp(-((lags[None] * (x[1] - x[0]) / reaches[:, None]) ** 2))
        shares = np.clip(shapes @ (seen / power) / (shapes * shapes).sum(axis=1), 0.0, 1 - WHITE)
        misfit = ((seen / power - shares[:, None] * shapes) ** 2).sum(axis=1)
        # Lengths that fit alike count alike: a choice between them would make the section jump.
        chance = np.exp(-SHARPNESS * (misfit / max(float(misfit.min()), 1e-12) - 1))
        chance /= chance.sum()
    noise = np.zeros((w, w))
    for reach, share, part in zip(reaches.tolist(), shares.tolist(), chance.tolist(), strict=True):
        noise += part * (share * np.exp(-apart / reach**2) + (1 - share) * np.eye(w))
    tilt = x / np.abs(x).max()
    return noise + PARENT**2 * (1 + np.outer(tilt, tilt))
