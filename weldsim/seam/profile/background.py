"""Does a groove stand out against what the same surface does elsewhere?

A depth camera's errors are alike over a centimetre and more, longer along its rows, and a smooth furrow of them looks like
a shallow groove. The noise of single pixels says nothing about that; the surface beside the candidate does. A matched
filter: the candidate's cross-section is fitted in short blocks along its own line. The same blocks, moved without turning
to other places of the same chart, give the spread of such fits where there is no groove, and their correlation along the
line. The candidate's mean amplitude is compared with what that background makes of a line as long.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.seam.profile.chart import Chart
from weldsim.seam.profile.ends import trusted
from weldsim.seam.profile.refine import Fit
from weldsim.seam.profile.valley import MODE_REACH, local_slope

BLOCK = 0.008  # [m] along the line: about the shortest length over which a depth camera's error is alike
ALONG = 4  # samples along a block
ACROSS = 0.00125  # [m] between samples across it: as fine as the charts
SIDE = 0.020  # [m] of surface read on either side of the section
SHIFTS = 300  # places tried all over the chart; most of them lie off the part. As many again are tried NEAR
NEAR = 0.10  # [m] either way: where the viewpoint is unknown or wrong, noise differs from one end of a cloud to the other
MOST_BLOCKS = 40  # of a longer line the middle is compared
FEWEST = 24  # placed blocks that tell a spread
WAVES = 0.003  # [m] rms about a smooth surface, from which on a place is an edge or an object
ODD, LEAST_WAVES = 2.5, 2e-4  # times the usual rms, and more than that [m], from which on it is one too
CORE_HELD, SIDE_HELD = 0.7, 0.5  # of a block's samples, in the section and on either side, must have data
BLUNTED = 1.4  # variance of an amplitude, over that of one from a whole block, from which on missing samples spoil it
SHOULDER = 0.003  # [m] beyond the blurred lips of a groove that is no background either
LARGEST = 2.0  # amplitude at which one of the candidate's blocks counts as no more: a hole is no long groove
SHOWN = 0.5  # of the candidate's own blocks a chart must hold to speak of it
LAGS = 12  # blocks over which correlation along the line is followed
LEAST_CORRELATION = 0.05  # under which the rest is taken as independent
CLIP = 3.0  # standard deviations at which a block counts as no more, in the correlation
ODD_PLACE = 2.0  # looks that one odd place of a surface may spoil
FREEDOM = 1.0  # standard deviations that each independent stretch gains by the line's being led along the deepest places


@dataclass(frozen=True)
class Standing:
    """How far a groove stands out.

    Attributes:
        ratio: mean amplitude over its standard deviation in the background.
        looks: how many independent stretches of background its length holds.
        spread: standard deviation of a block's amplitude elsewhere, in units of the candidate's own section.
        alike: blocks over which the background is alike.
        elsewhere: blocks placed elsewhere; 0 where the surface has no other place, and the candidate's own scatter is taken.
        sighted: whether it is seen from a known viewpoint: without one, the back of a thing may look like a groove in another.
    """

    ratio: float
    looks: float
    spread: float
    alike: float
    elsewhere: int
    sighted: bool = True

    @property
    def score(self) -> float:
        """`ratio` less what a line that may choose its way gains from noise alone; of few looks less is believed, since all of
        them may lie in one odd place: a dent, a hole's rim."""
        return (self.ratio - FREEDOM * float(np.sqrt(self.looks))) / float(np.sqrt(1 + ODD_PLACE / self.looks))


def standing(
    fit: Fit, span: tuple[float, float], charts: Sequence[Chart], others: Sequence[Float[ndarray, "_ 3"]] = ()
) -> Standing | None:
    """How far a candidate stands out from its surface, in the chart that shows it best; None where none shows half of it.

    Args:
        charts: seen from above that surface.  others: (j, 3) places on other grooves, no background either [m]; see `lips`.
    """
    blocks = _blocks(fit, span)
    if blocks is None:
        return None
    best, best_shown = None, 0.0
    for chart in charts:
        own, facing = _own(fit, blocks, chart)
        shown = float(np.isfinite(own).mean()) * facing
        if np.isfinite(own).mean() >= SHOWN and np.isfinite(own).sum() >= 2 and shown > best_shown:
            best, best_shown = (chart, np.clip(own[np.isfinite(own)], -LARGEST, LARGEST)), shown
    return None if best is None else _compared(blocks, (lips(fit, span), *others), *best)


def lips(fit: Fit, span: tuple[float, float]) -> Float[ndarray, "j 3"]:
    """Places on the surface that a groove, as a camera blurs it, may reach [m], a millimetre apart."""
    stations = np.flatnonzero(trusted(fit, span))
    reach = 0.5 * (fit.section.width + fit.section.blur) + SHOULDER
    x = np.arange(-reach, reach + 5e-4, 1e-3)
    return (fit.rail.points[stations][:, None] + x[:, None] * fit.rail.e[stations][:, None]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Where a candidate is compared.

    Attributes:
        points: (m, ALONG, w, 3) samples of each block [m].  x: (w,) their places across [m].
        section: (w,) apparent depth [m].  core: (w,) samples in it.
    """

    points: Float[ndarray, "m a w 3"]
    x: Float[ndarray, "w"]
    section: Float[ndarray, "w"]
    core: Bool[ndarray, "w"]


def _blocks(fit: Fit, span: tuple[float, float]) -> _Blocks | None:
    """The blocks of a candidate's span, gaps left out; None where there are fewer than two."""
    rail, stations = fit.rail, np.flatnonzero(trusted(fit, span))
    per = max(1, round(BLOCK / rail.step))
    m = len(stations) // per
    if m < 2:
        return None
    within = np.unique(np.linspace(0, per - 1, ALONG).round().astype(int))
    picked = stations[: m * per].reshape(m, per)[:, within]
    first = max(0, (m - MOST_BLOCKS) // 2)
    picked = picked[first : first + MOST_BLOCKS]
    reach = 0.5 * (fit.section.width + fit.section.blur)
    x = np.arange(-reach - SIDE, reach + SIDE + ACROSS / 2, ACROSS)
    points = rail.points[picked][:, :, None] + x[:, None] * rail.e[picked][:, :, None]
    points = points + (fit.parent.c * x**2)[:, None] * rail.n[picked][:, :, None]
    section = fit.section.image(x, np.median(fit.grid.shear, keepdims=True))[0][0]
    return _Blocks(points, x, section, np.abs(x) < reach)


def _own(fit: Fit, blocks: _Blocks, chart: Chart) -> tuple[Float[ndarray, "m"], float]:
    """Amplitude of each of the candidate's own blocks, NaN without data, and the cosine at which the chart faces it."""
    sight = chart.axes[2]
    if chart.perspective:
        away = fit.rail.points[len(fit.rail) // 2] - chart.origin
        sight = away / max(float(np.linalg.norm(away)), 1e-9)
    facing = max(0.0, -float(sight @ fit.rail.n[len(fit.rail) // 2]))
    amplitude, _ = _amplitudes(blocks, _cells(chart, blocks.points), np.zeros((1, 2), np.int64), chart.valid, chart.height)
    return amplitude[0], facing


def _compared(blocks: _Blocks, grooves: Sequence[Float[ndarray, "_ 3"]], chart: Chart, own: Float[ndarray, "k"]) -> Standing:
    """The candidate's amplitudes against those elsewhere in a chart, off all `grooves` [m]."""
    cells = _cells(chart, blocks.points)
    free = chart.valid & _own_surface(cells, chart)
    row, column = _cells(chart, np.concatenate(grooves)).T
    inside = (row >= 0) & (column >= 0) & (row < free.shape[0]) & (column < free.shape[1])
    free[row[inside], column[inside]] = False
    amplitude, rough = _amplitudes(blocks, cells, _shifts(cells, chart), free, chart.height)
    held = rough[np.isfinite(amplitude)]
    usual = ODD * float(np.median(held)) + LEAST_WAVES if len(held) else WAVES
    placed = np.where(rough < min(usual, WAVES), amplitude, np.nan)
    spreads = [_spread(part) for part in (placed[:SHIFTS], placed[SHIFTS:])]
    spread = max((each for each in spreads if each is not None), default=None)
    if spread is None:
        spread, alike, number = float(own.std(ddof=1)), 1.0, 0
    else:
        alike, number = _alike(placed / max(spread, 1e-9), len(own)), int(np.isfinite(placed).sum())
    looks = len(own) / alike
    return Standing(float(own.mean()) / max(spread, 1e-6) * float(np.sqrt(looks)), looks, spread, alike, number, chart.perspective)


def _own_surface(cells: Int[ndarray, "m a w 2"], chart: Chart) -> Bool[ndarray, "r c"]:
    """Cells that lie as the candidate's surface does: a table behind a tilted part has another noise."""
    slope = local_slope(chart)
    h, w = chart.valid.shape
    row, column = np.clip(cells[..., 0], 0, h - 1), np.clip(cells[..., 1], 0, w - 1)
    here = slope[row, column].reshape(len(cells), -1, 2)
    here = np.where(np.isfinite(here), here, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a block without any
        usual = np.nanmedian(here, axis=1)
        low, high = np.nanmin(usual, axis=0) - MODE_REACH, np.nanmax(usual, axis=0) + MODE_REACH
    return np.asarray(((slope > low) & (slope < high)).all(axis=-1))


def _spread(placed: Float[ndarray, "q m"]) -> float | None:
    """Robust standard deviation of amplitudes about 0, None where they are too few: the larger of two figures, since the
    middle tells the usual waves, the tail what else lies about."""
    known = np.abs(placed[np.isfinite(placed)])
    if len(known) < FEWEST:
        return None
    return max(1.4826 * float(np.median(known)), float(np.quantile(known, 0.9)) / 1.645)


def _cells(chart: Chart, points: Float[ndarray, "*k 3"]) -> Int[ndarray, "*k 2"]:
    """Row and column of the cells in which points [m] are seen."""
    local = (points - chart.origin) @ chart.axes.T
    uv = local[..., :2] / np.maximum(local[..., 2:], 1e-3) if chart.perspective else local[..., :2]
    return np.floor((uv - chart.corner) / chart.step).astype(np.int64)[..., ::-1]


def _shifts(cells: Int[ndarray, "m a w 2"], chart: Chart) -> Int[ndarray, "q 2"]:
    """Moves (rows, columns), drawn alike every time: SHIFTS that keep some of the pattern within the chart, SHIFTS NEAR."""
    flat = cells.reshape(-1, 2)
    low, high = -flat.max(axis=0), np.array(chart.valid.shape) - flat.min(axis=0)
    draw = np.random.default_rng(0)
    anywhere = low + draw.random((SHIFTS, 2)) * (high - low)
    near = (2 * draw.random((SHIFTS, 2)) - 1) * NEAR / chart.pitch
    return np.concatenate([anywhere, near]).astype(np.int64)


def _amplitudes(
    blocks: _Blocks,
    cells: Int[ndarray, "m a w 2"],
    shifts: Int[ndarray, "q 2"],
    free: Bool[ndarray, "r c"],
    height: Float[ndarray, "r c"],
) -> tuple[Float[ndarray, "q m"], Float[ndarray, "q m"]]:
    """Amplitude of the section in each block at each shift, NaN without data, and the rms [m] about the fit.

    Fitted by least squares together with a parabola across, as the parent surface.
    """
    x, core = blocks.x, blocks.core
    total, count = _profiles(cells, shifts, free, height)
    held = count > 0.5 * cells.shape[1]
    enough = held[..., core].mean(axis=-1) >= CORE_HELD
    for side in (~core & (x > 0), ~core & (x < 0)):
        enough &= held[..., side].mean(axis=-1) >= SIDE_HELD
    amplitude, rough = np.full(enough.shape, np.nan), np.full(enough.shape, np.inf)
    if enough.any():
        weight = held[enough].astype(float)
        depth = total[enough] / np.maximum(count[enough], 1)
        u = x / np.abs(x).max()
        design = np.stack([-blocks.section, np.ones_like(u), u, u**2], axis=1)
        whole = np.linalg.inv(design.T @ design + 1e-12 * np.eye(4))
        inverse = np.repeat(whole[None], len(weight), axis=0)
        lacking = ~held[enough].all(axis=1)
        products = (design[:, :, None] * design[:, None, :]).reshape(len(u), 16)
        inverse[lacking] = np.linalg.inv((weight[lacking] @ products).reshape(-1, 4, 4) + 1e-12 * np.eye(4))
        theta = np.einsum("kij,kj->ki", inverse, (weight * depth) @ design)
        amplitude[enough] = np.where(inverse[:, 0, 0] < BLUNTED * whole[0, 0], theta[:, 0], np.nan)
        left = weight * (depth - theta @ design.T) ** 2
        rough[enough] = np.sqrt(left.sum(axis=1) / weight.sum(axis=1))
    return amplitude, rough


def _profiles(
    cells: Int[ndarray, "m a w 2"], shifts: Int[ndarray, "q 2"], free: Bool[ndarray, "r c"], height: Float[ndarray, "r c"]
) -> tuple[Float[ndarray, "q m w"], Float[ndarray, "q m w"]]:
    """Sum of the heights [m] over each block's samples along the line, and their number, at each shift."""
    from weldsim.seam.profile import native

    h, w = free.shape
    # One border of empty cells stands for all that lies outside.
    known = np.zeros((h + 2, w + 2), np.float32)
    known[1:-1, 1:-1] = free
    values = np.zeros_like(known)
    values[1:-1, 1:-1] = np.where(free, height, 0.0)
    shape = (len(shifts), cells.shape[0], cells.shape[2])
    total, count = np.empty(shape, np.float32), np.empty(shape, np.float32)
    row, column = (np.ascontiguousarray(cells[..., k]) for k in (0, 1))
    native.profiles(row, column, shifts, known, values, total, count)
    return total, count


def _alike(placed: Float[ndarray, "q m"], blocks: int) -> float:
    """By how much correlation along the line raises the variance of the mean of so many blocks.

    Args:
        placed: amplitudes over their standard deviation, NaN without data.
    """
    values = np.clip(placed, -CLIP, CLIP)
    known = np.isfinite(values)
    variance = float(np.mean(values[known] ** 2))
    total = 1.0
    for lag in range(1, min(LAGS, values.shape[1] - 1, blocks - 1) + 1):
        both = known[:, lag:] & known[:, :-lag]
        if np.count_nonzero(both) < FEWEST:
            break
        correlation = float(np.mean(values[:, lag:][both] * values[:, :-lag][both])) / max(variance, 1e-12)
        if correlation < LEAST_CORRELATION:
            break
        total += 2 * (1 - lag / blocks) * correlation
    return total
