"""Where a groove begins and ends: where it fades inside the plate, or where the plate itself ends."""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.parent import CELL
from weldsim.seam.profile.refine import BRIDGE, Fit, sided
from weldsim.seam.profile.track import ABSENT, LONGEST_DIP

NEAR = 0.014  # [m] beyond the lips' surroundings, over which the plate's edge is read
SHORTEST_GAP = 0.005  # [m] a shorter stretch unseen is not worth a word
ONE_SIDED = 0.003  # [m] a groove is followed past the plate on one side where no edge of it is seen
PAST_EDGE = 0.002  # [m] and past an edge that is
FEWEST_COLUMNS = 3  # of a side's cells that show where its plate ends
ASLANT = 0.3  # slope of an edge across the groove, read on one side of it alone
APART = 0.010  # [m] from which on the edges left and right of a groove may be two plates'
NEARER = 0.5  # of its distance to one line, at which two square edges lie from where a plate's columns end
RUN_OUT = 0.010  # [m] the most an end is carried past the last station whose depth can be trusted


def seam_span(fit: Fit, config: ProfileConfig) -> tuple[float, float]:
    """Arc length on the rail [m] at which the groove begins and ends.

    From the stretch with parent surface on both sides the groove is followed outward while its depth stays like a
    groove's. Where the depth fades, the end is where it halves. Where the plate ends, its edge is drawn as a line
    through the last parent surface left and right, and the end is where that line crosses the groove.
    """
    core = fit.core
    return _end(fit, core.start, -1), _end(fit, core.stop - 1, +1)


def _end(fit: Fit, last: int, way: int) -> float:
    amplitude, step = fit.track.amplitude, fit.rail.step
    one_side = (fit.parent.support.max(axis=1) > 0.5) | (np.broadcast_to(fit.track.run_out, amplitude.shape) > 0)
    edge = _edge_crossing(fit, way, last * step)
    most = ONE_SIDED if edge is None else max((edge - last * step) * way + PAST_EDGE, 0.0)
    j = last
    while 0 <= j + way < len(amplitude) and 0.5 < np.nan_to_num(amplitude[j + way]) < 1.5 and one_side[j + way]:
        if abs(j + way - last) * step > most:  # a bevel goes on past its partner, a groove does not
            return j * step
        j += way
    beyond, here = j + way, j * step
    if edge is not None and step <= (edge - here) * way < LONGEST_DIP:
        # Noise may hide the last of a groove that runs out over the plate's edge.
        stretch = slice(j + 1, round(edge / step) + 1) if way > 0 else slice(max(round(edge / step), 0), j)
        if len(amplitude[stretch]) and np.isfinite(amplitude[stretch]).mean() > 0.5 and fit.track.absence(stretch) < ABSENT:
            return edge
    if 0 <= beyond < len(amplitude) and np.nan_to_num(amplitude[beyond], nan=9.0) <= 0.5 and one_side[beyond]:
        drop = amplitude[j] - amplitude[beyond]
        return here + way * step * float(np.clip((amplitude[j] - 0.5) / max(drop, 1e-6), 0.0, 1.0))
    if edge is None:
        return here
    return float(np.clip(edge, here - PAST_EDGE, here + RUN_OUT) if way > 0 else np.clip(edge, here - RUN_OUT, here + PAST_EDGE))


def _edge_crossing(fit: Fit, way: int, here: float) -> float | None:
    """Arc length [m] at which the parent surface's edge crosses the groove, or None where it has no edge nearby.

    Where the plate on one side goes on, the groove ends with the other plate.
    """
    s, x = fit.parent.cells.T
    near = (np.abs(x) < fit.inner + NEAR) & (np.abs(s - here) < 0.045)
    if np.count_nonzero(near) < 20:
        return None
    column = np.round(x[near] / CELL).astype(int)
    ends = []
    for k in np.unique(column):
        outward = np.sort(s[near][column == k] * way)[::-1]
        # The last cell of the body: two more follow it closely, so that a lone cell beyond a gap does not count.
        body = np.flatnonzero(outward[:-2] - outward[2:] < 3.5 * CELL) if len(outward) > 2 else []
        if len(body):
            ends.append((k * CELL, way * (outward[body[0]] + CELL / 2)))
    if not ends:
        return None
    across, edge = np.array(ends).T
    # Nothing is known beyond the rail's own end.
    limit = min(here + 0.044, (len(fit.rail) - 1) * fit.rail.step) if way > 0 else max(here - 0.044, 0.0)
    goes_on = (limit - edge) * way < 1.5 * CELL
    left, right = across > 0, across < 0
    if goes_on.mean() > 0.3 and not (_held(left, goes_on) and _held(right, goes_on)):
        # The plate on one side goes on, or the edge is so far aslant that it leaves what is known.
        ended = [side for side in (left, right) if (side & ~goes_on).sum() >= FEWEST_COLUMNS and goes_on[side].mean() <= 0.3]
        return _one_edge(across[ended[0]], edge[ended[0]]) if len(ended) == 1 and goes_on[~ended[0]].mean() > 0.7 else None
    across, edge = across[~goes_on], edge[~goes_on]
    if len(across) < 2 * FEWEST_COLUMNS:
        return None
    two = _two_edges(across, edge, way)
    if two is not None:
        return way * min(way * two[0], way * two[1])  # the groove ends with the first
    slope, level = _median_line(across, edge)
    off = np.abs(edge - level - slope * across)
    keep = off <= max(2.5 * float(np.median(off)), 0.0015)
    if keep.sum() < 2 * FEWEST_COLUMNS:
        return None
    slope, level = np.polyfit(across[keep], edge[keep], 1).tolist()
    return _of_cells(slope, level, way)


def _held(side: Bool[ndarray, "k"], goes_on: Bool[ndarray, "k"]) -> bool:
    """Whether the edge shows in enough columns of a side to be drawn through."""
    return bool((side & ~goes_on).sum() >= FEWEST_COLUMNS)


def _one_edge(across: Float[ndarray, "k"], edge: Float[ndarray, "k"]) -> float:
    """Where the edge of the plate on one side, carried on to the groove, crosses it [m]; square unless it is clearly aslant."""
    slope, level = _median_line(across, edge)
    return level if abs(slope) > ASLANT else float(np.median(edge))


def _two_edges(across: Float[ndarray, "k"], edge: Float[ndarray, "k"], way: int) -> tuple[float, float] | None:
    """Where the edges left and right of a groove cross it [m], if they are two; None where one edge runs across it.

    Of two plates they are square and lie apart; of one plate's corner both are aslant, and lean against each other. Such
    edges are much nearer to the columns' ends than any one line is.
    """
    sides = [side for side in (across > 0, across < 0) if side.sum() >= FEWEST_COLUMNS]
    if len(sides) < 2:
        return None
    slope, level = _median_line(across, edge)
    off_line = float(np.median(np.abs(edge - level - slope * across)))
    one, other = (float(np.median(edge[side])) for side in sides)
    off_squares = float(np.median(np.abs(edge - np.where(across > 0, one, other))))
    if abs(one - other) > APART and off_squares < NEARER * off_line:
        return one, other
    lines = [_median_line(across[side], edge[side]) for side in sides]
    off_corner = np.concatenate(
        [np.abs(edge[side] - line[1] - line[0] * across[side]) for side, line in zip(sides, lines, strict=True)]
    )
    against = lines[0][0] * lines[1][0] < 0 and min(abs(line[0]) for line in lines) > ASLANT
    if not against or float(np.median(off_corner)) >= NEARER * off_line:
        return None
    first, second = (_of_cells(slope, level, way) for slope, level in lines)
    return first, second


def _of_cells(slope: float, level: float, way: int) -> float:
    """Where an edge aslant crosses the groove [m]: a cell across it reaches past it by as much as its farther corner does."""
    return level - way * abs(slope) * CELL / 2


def _median_line(x: Float[ndarray, "k"], y: Float[ndarray, "k"]) -> tuple[float, float]:
    """Slope and value at 0 of the line of median slope through pairs of points (Theil-Sen)."""
    i, j = np.triu_indices(len(x), 1)
    apart = x[i] != x[j]
    slope = float(np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart]))
    return slope, float(np.median(y - slope * x))


def station_mask(fit: Fit, span: tuple[float, float]) -> Bool[ndarray, "m"]:
    """Stations within a span of arc length [m]."""
    s: Float[ndarray, "m"] = np.arange(len(fit.rail)) * fit.rail.step
    return (s >= span[0]) & (s <= span[1])


def gaps(fit: Fit, span: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """Stretches of the span (s0, s1) [m] over which no groove was seen, SHORTEST_GAP or longer."""
    seen = np.flatnonzero((fit.track.weight > 0) & station_mask(fit, span))
    step = fit.rail.step
    wide = np.flatnonzero(np.diff(seen) * step >= SHORTEST_GAP)
    return tuple((float(seen[k] * step), float(seen[k + 1] * step)) for k in wide)


def trusted(fit: Fit, span: tuple[float, float]) -> Bool[ndarray, "m"]:
    """Stations within a span that speak for or against a groove: in a fit of joined pieces, those in no gap."""
    inside = station_mask(fit, span)
    for s0, s1 in gaps(fit, span) if fit.bridge > BRIDGE else ():
        inside &= ~station_mask(fit, (s0 + 0.5 * fit.rail.step, s1 - 0.5 * fit.rail.step))
    return inside


def supported(fit: Fit, span: tuple[float, float], config: ProfileConfig) -> float:
    """Fraction of the span's stations, gaps between joined pieces aside, at which it is seen between two parent surfaces."""
    inside = trusted(fit, span)
    return float(np.mean((fit.track.weight > 0)[inside] & sided(fit.parent, config)[inside])) if inside.any() else 0.0
