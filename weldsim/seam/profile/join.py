"""Pieces of one groove, parted by a clamp, a tack weld or missing data, made one; and what is known across the gap."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.curves import interpolate
from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import Atlas
from weldsim.seam.profile.ends import gaps, seam_span, station_mask
from weldsim.seam.profile.grow import fit_line
from weldsim.seam.profile.judge import refusal
from weldsim.seam.profile.meet import End, alike, faces, lead_across
from weldsim.seam.profile.refine import BRIDGE, Fit

DISTURBED = 0.012  # [m] of a piece's end that what ends it may have bent
END_REACH = 0.030  # [m] of a piece from which its end's direction is read
KEPT = 0.85  # of the stations seen in two pieces that their common fit has to see again
GROWTH = 3.0  # power of the length with which the error of a bridge grows
PLAIN = 0.6  # of a gap's cells at the plate's own level: nothing lies across the groove there, it stops


@dataclass(frozen=True, eq=False)
class Piece:
    """A fitted groove, from s = span[0] to span[1] on its rail [m]; `whole` if it is a seam by itself."""

    fit: Fit
    span: tuple[float, float]
    whole: bool


def join_pieces(pieces: list[Piece], atlas: Atlas, config: ProfileConfig) -> list[Piece]:
    """The pieces, those that belong together refitted as one; pieces that are no seam by themselves and join none stay.

    Two pieces belong together if their ends face each other across at most `config.max_gap`, their sections are alike,
    one of them is a seam by itself, and one fit through both sees both again.
    """
    failed: set[frozenset[int]] = set()
    while True:
        found = next(_partners(pieces, failed, config), None)
        if found is None:
            return pieces
        (a, end_a), (b, end_b) = found
        joined = _joined(a, end_a, b, end_b, atlas, config)
        if joined is None:
            failed.add(frozenset((id(a), id(b))))
        else:
            pieces = [joined, *(piece for piece in pieces if piece is not a and piece is not b)]


def piece_end(piece: Piece, way: int) -> End:
    """The end of a piece at its last (way = 1) or first (way = -1) station."""
    fit, rail = piece.fit, piece.fit.rail
    index = np.flatnonzero(station_mask(fit, piece.span))[::-way]
    place = np.arange(len(index)) * rail.step
    skip = min(DISTURBED, 0.25 * place[-1])
    read = (place >= skip) & (place <= skip + END_REACH)
    # A parabola from the end inward, through what lies clear of a clamp's foot: that lifts the parent surface it stands on.
    degree = min(2, max(1, int(np.count_nonzero(read)) - 1))  # two stations, as far apart as they may be set, carry a line alone
    fitted = np.polynomial.polynomial.polyfit(place[read], rail.points[index[read]], degree)
    curve = np.pad(fitted, ((0, 2 - degree), (0, 0)))
    sigma = float(fit.sigma[index].mean())
    turn = 4 * sigma / max(float(np.ptp(place[read])), rail.step)
    return End(
        point=curve[0],
        direction=unit(-curve[1]),
        normal=rail.n[index[read][0]],
        bend=2 * curve[2],
        sigma=float(np.hypot(sigma, skip * turn)),  # the end itself was carried over what was not read
        turn=turn,
        width=fit.section.width,
        depth=fit.section.depth,
        skipped=skip,
    )


def _partners(pieces: list[Piece], failed: set[frozenset[int]], config: ProfileConfig):
    """Pairs of (piece, way) whose ends face each other, the nearest first."""
    found = []
    ends = {id(piece): {way: piece_end(piece, way) for way in (-1, 1)} for piece in pieces}
    for a, b in combinations(pieces, 2):
        if not (a.whole or b.whole) or frozenset((id(a), id(b))) in failed:
            continue
        for way_a in (-1, 1):
            for way_b in (-1, 1):
                one, other = ends[id(a)][way_a], ends[id(b)][way_b]
                if alike(one, other) and faces(one, other, config.max_gap):
                    gap = float(np.linalg.norm(one.point - other.point))
                    found.append((gap, (a, way_a), (b, way_b)))
    found.sort(key=lambda pair: pair[0])
    yield from ((a, b) for _, a, b in found)


def _joined(a: Piece, way_a: int, b: Piece, way_b: int, atlas: Atlas, config: ProfileConfig) -> Piece | None:
    """One piece through both, or None where a common fit does not carry both."""
    end_a, end_b = piece_end(a, way_a), piece_end(b, way_b)
    across, lean = lead_across(end_a, end_b, config.station_step)
    in_a = np.flatnonzero(station_mask(a.fit, a.span))[::way_a]
    in_b = np.flatnonzero(station_mask(b.fit, b.span))[::-way_b]
    skip = [round(min(DISTURBED / piece.fit.rail.step, 0.25 * len(inside))) for piece, inside in ((a, in_a), (b, in_b))]
    # Where the pieces lie alongside each other, the second begins where the first ends.
    past = (b.fit.rail.points[in_b] - end_a.point) @ end_a.direction > 0
    in_b = in_b[int(np.argmax(past)) :] if past.any() else in_b
    if past.any() and not past[0]:
        across, lean = across[:0], lean[:0]
    else:
        in_a, in_b = in_a[: len(in_a) - skip[0]], in_b[skip[1] :]
    line = np.concatenate([a.fit.rail.points[in_a], across, b.fit.rail.points[in_b]])
    normals = np.concatenate([a.fit.rail.n[in_a], lean, b.fit.rail.n[in_b]])
    longer = a if len(in_a) >= len(in_b) else b
    gap = float(np.linalg.norm(end_b.point - end_a.point))
    bridge = max(gap + BRIDGE, a.fit.bridge, b.fit.bridge)
    found = refit(line, normals, replace(longer.fit, bridge=bridge), atlas, config)
    return found if found is not None and seen(found) >= KEPT * (seen(a) + seen(b)) else None


def seen(piece: Piece) -> int:
    """Stations at which the groove was seen."""
    return int(np.count_nonzero((piece.fit.track.weight > 0) & station_mask(piece.fit, piece.span)))


def refit(
    line: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], known: Fit, atlas: Atlas, config: ProfileConfig
) -> Piece | None:
    """The seam along a line across a gap, with what is not known there told by sigma, or None where it is refused.

    Args:
        line, normals: (k, 3) of the rail to begin from [m].  known: gives the section to begin from, and the bridge.
    """
    fit = fit_line(atlas, line, normals, known.section, config, known.bridge)
    if fit is None:
        return None
    span = seam_span(fit, config)
    if refusal(fit, span, config) is not None:
        return None
    if any(s1 - s0 > config.max_gap for s0, s1 in gaps(fit, span)):
        return None
    if any(s1 - s0 > config.max_filled and _plain(fit, s0, s1) for s0, s1 in gaps(fit, span)):
        return None
    return Piece(replace(fit, sigma=_sigma_with_gaps(fit, span)), span, whole=True)


def _plain(fit: Fit, s0: float, s1: float) -> bool:
    """Whether the plate's own surface is seen where the groove should be."""
    grid = fit.grid
    rows: Bool[ndarray, "m"] = station_mask(fit, (s0, s1))
    patch = grid.depth[rows][:, np.abs(grid.x) < 0.3 * fit.section.width]
    level = np.abs(patch) < max(0.3 * fit.section.depth, 0.0005)
    return bool(np.isfinite(patch).mean() > 0.05 and level[np.isfinite(patch)].mean() > PLAIN)


def _sigma_with_gaps(fit: Fit, span: tuple[float, float]) -> Float[ndarray, "m"]:
    """The fit's sigma [m], raised in each gap by the error that bridges of its length make where the groove was seen."""
    sigma, step = fit.sigma.copy(), fit.rail.step
    for s0, s1 in gaps(fit, span):
        first, last = round(s0 / step), round(s1 / step)
        inside = np.arange(first, last + 1)
        error = _bridge_error(fit, span, last - first)
        u = (inside - first) / (last - first)
        # Both banks' directions are known from END_REACH of the seam, so the curve between them swings with both.
        turn = 4 * max(fit.sigma[first], fit.sigma[last]) / END_REACH
        swing = (s1 - s0) * turn * np.hypot(u * (1 - u) ** 2, u**2 * (1 - u))
        sigma[inside] = np.sqrt(sigma[inside] ** 2 + np.interp(u, np.linspace(0, 1, len(error)), error) ** 2 + swing**2)
    return sigma


def _bridge_error(fit: Fit, span: tuple[float, float], length: int) -> Float[ndarray, "k"]:
    """rms error [m] along a bridge over `length` stations, from bridges laid over stretches of the rail that was seen.

    Where no such stretch is long enough, shorter bridges tell, their error scaled by GROWTH.
    """
    rail = fit.rail
    seen = (fit.track.weight > 0) & station_mask(fit, span)
    runs = np.flatnonzero(np.diff(np.concatenate([[0], seen.astype(np.int8), [0]]))).reshape(-1, 2)
    longest = int((runs[:, 1] - runs[:, 0]).max(initial=0))
    tried = min(length, longest - 2)
    if tried < 4:
        return np.full(3, 0.5 * fit.section.width)
    squares = []
    for begin, stop in runs:
        for first in range(begin, stop - tried, max(tried // 4, 1)):
            last = first + tried
            line, _ = lead_across(_rail_end(fit, first, 1), _rail_end(fit, last, -1), rail.step)
            u = np.linspace(0, 1, len(line) + 2)[1:-1]
            true = interpolate(np.linspace(0, 1, tried + 1), rail.points[first : last + 1], u)
            off = line - true
            squares.append(np.interp(np.linspace(0, 1, 21), u, (off**2).sum(axis=1), left=0.0, right=0.0))
    even = np.mean(squares, axis=0)
    return np.sqrt(0.5 * (even + even[::-1])) * (length / tried) ** GROWTH


def _rail_end(fit: Fit, station: int, way: int) -> End:
    """A station of a rail as the end of a piece that looks along `way`."""
    rail, zero = fit.rail, np.zeros(3)
    return End(rail.points[station], way * rail.t[station], rail.n[station], zero, 0.0, 0.0, fit.section.width, fit.section.depth)
