"""A groove carried on past a gap at its end, where the coarse search found no line of its own."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import Atlas
from weldsim.seam.profile.chart import Chart
from weldsim.seam.profile.ends import station_mask
from weldsim.seam.profile.join import Piece, piece_end, refit, seen
from weldsim.seam.profile.refine import BRIDGE

LOOKS = 15  # looks at the piece itself, to see how deep it shows
STEP = 0.002  # [m] between two looks at the chart
PROBE = 0.030  # [m] looked at beyond the longest gap
MOST_SEEN = 0.012  # [m] of groove that have to show there
BESIDE = 0.005  # [m] beyond the lips, where the plate is looked at
STRETCHES = 6  # a groove is carried on at either end so many times at most
STRAY = 0.1  # [m/m] that the plate may leave the plane of the end, with 3 mm to begin with


def carry_on(piece: Piece, atlas: Atlas, config: ProfileConfig) -> Piece:
    """The piece with what goes on beyond its ends, past gaps of at most `config.max_gap`, where a chart shows a groove."""
    for way in (-1, 1):
        for _ in range(STRETCHES):
            longer = _carried(piece, way, atlas, config)
            if longer is None:
                break
            piece = longer
    return piece


def _carried(piece: Piece, way: int, atlas: Atlas, config: ProfileConfig) -> Piece | None:
    """The piece carried on at one end, or None where nothing is seen there or the fit does not bear it out."""
    onward = _seen_beyond(piece, way, atlas, config)
    if onward is None:
        return None
    fit = piece.fit
    inside = np.flatnonzero(station_mask(fit, piece.span))[::way]
    line = np.concatenate([fit.rail.points[inside], onward])
    normals = np.concatenate([fit.rail.n[inside], np.repeat(fit.rail.n[inside[-1:]], len(onward), 0)])
    known = replace(fit, bridge=max(fit.bridge, config.max_gap + BRIDGE))
    longer = refit(line, normals, known, atlas, config)
    gained = longer is not None and seen(longer) >= seen(piece) + 0.5 * MOST_SEEN / fit.rail.step
    return longer if gained else None


def _seen_beyond(piece: Piece, way: int, atlas: Atlas, config: ProfileConfig) -> Float[ndarray, "k 3"] | None:
    """The line carried on to the end of the groove seen beyond a piece's end [m], or None where no chart shows one."""
    end = piece_end(piece, way)
    d = np.arange(1, round((config.max_gap + PROBE) / STEP) + 1) * STEP
    line = end.point + d[:, None] * end.direction + 0.5 * d[:, None] ** 2 * end.bend
    side = unit(np.cross(end.normal, end.direction)) * (0.5 * end.width + BESIDE)
    inside = piece.fit.rail.points[station_mask(piece.fit, piece.span)][::-way][:: round(STEP / piece.fit.rail.step)][:LOOKS]
    groove = np.zeros(len(d), bool)
    for chart in atlas.facing(end.point, end.normal):
        groove |= _shown(chart, inside, line, d, side)
    if np.count_nonzero(groove & (d > BRIDGE)) * STEP < MOST_SEEN:
        return None
    return line[: np.flatnonzero(groove)[-1] + 1]


def _shown(
    chart: Chart, inside: Float[ndarray, "j 3"], line: Float[ndarray, "k 3"], d: Float[ndarray, "k"], side: Float[ndarray, "3"]
) -> Bool[ndarray, "k"]:
    """Which points of a line beyond an end dip in a chart as the piece does itself, with the plate at their sides.

    Args:
        inside: of the piece [m].  line, d: beyond it, and how far [m].  side: from the line to beside the groove [m].
    """
    own, _ = _dips(chart, inside, side)
    if np.isfinite(own).mean() < 0.5:
        return np.zeros(len(d), bool)
    shown = float(np.nanmedian(own))
    dip, off = _dips(chart, line, side)
    with np.errstate(invalid="ignore"):
        return (dip > 0.5 * shown) & (dip < 1.6 * shown + 0.001) & (off < 0.003 + STRAY * d)


def _dips(chart: Chart, line: Float[ndarray, "k 3"], side: Float[ndarray, "3"]) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"]]:
    """How far the chart dips under each point of a line against both sides [m], and how far the sides lie off it [m]."""
    _, middle = chart.heights(line)
    own_left, left = chart.heights(line + side)
    own_right, right = chart.heights(line - side)
    return 0.5 * (left + right) - middle, np.maximum(np.abs(left - own_left), np.abs(right - own_right))
