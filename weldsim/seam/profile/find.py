"""The default seam finder: grooves by fitting cross-sections along a smooth curve.

Coarse: valleys of the cloud's chart (`chart`, `valley`). Fine: each candidate is measured along its own rail
(`refine`), ended (`ends`) and judged (`judge`). No threshold is typed: the coarse one comes from the valley image's own
background, the smoothing from the likelihood of correlated noise, the blur of the camera's support window from the
groove's own shape.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.curves import arc_length, project
from weldsim.records import PointCloud, Rejection, SeamFindings
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.atlas import Atlas, make_atlas
from weldsim.seam.profile.background import Standing, lips, standing
from weldsim.seam.profile.beyond import carry_on
from weldsim.seam.profile.branches import part_at_branches
from weldsim.seam.profile.corners import lay_courses
from weldsim.seam.profile.course import Course, to_seam
from weldsim.seam.profile.ends import seam_span, station_mask
from weldsim.seam.profile.grid import ray_coordinates
from weldsim.seam.profile.grow import grow, uncovered
from weldsim.seam.profile.join import Piece, gaps, join_pieces
from weldsim.seam.profile.judge import confidence, doubt, refusal, sideless
from weldsim.seam.profile.lost import Lost
from weldsim.seam.profile.rail import lay_out
from weldsim.seam.profile.refine import Fit
from weldsim.seam.profile.track import deepest
from weldsim.seam.profile.valley import CoarseLine
from weldsim.seam.profile.window import at_one_window

LONG = 0.05  # [m] a seam of this length is half as good as the same one without end
LIKELY = 3.0  # times over the background, from which on a candidate is left out of that of others: it may be a groove
MIN_LEVEL = 0.5  # of a coarse line must have surface at one level on both sides
MOST_REMAINDERS = 3  # times what is left of a coarse line is tried again


def find_seams_profile(cloud: PointCloud, config: ProfileConfig, threshold_factor: float = 1.0) -> SeamFindings:
    """Every groove of a cloud, best first, with what was refused and why.

    Args:
        cloud: in B, at least a few hundred points.
        threshold_factor: multiplies the coarse threshold, to see how much it matters.
    """
    atlas = make_atlas(cloud)
    lines, threshold = atlas.coarse_lines(config, threshold_factor)
    accepted, rejected = _search(atlas, lines, config)
    stands = _standings(accepted, atlas)
    found: list[tuple[Course, float]] = []
    for course in lay_courses(accepted, config):
        why = doubt([stands.get(id(piece)) for piece in course.pieces])
        if why is None:
            found.append((course, _confidence(course, stands, config)))
        else:
            rejected.append(_rejection(course.points, *why))
    found.sort(key=lambda each: _merit(*each), reverse=True)
    region = np.zeros(len(cloud), np.int32)
    for number, (course, _) in enumerate(found, start=1):
        for piece in course.pieces:
            _mark_region(region, number, atlas, piece.fit, piece.span)
    seams = tuple(to_seam(course, sure) for course, sure in found)
    return SeamFindings(seams=seams, region=region, rejected=tuple(rejected), threshold=threshold, method="profile")


def _search(atlas: Atlas, coarse: list[CoarseLine], config: ProfileConfig) -> tuple[list[Piece], list[Rejection]]:
    """Seams along coarse lines, those in pieces joined, and what was refused.

    What a seam leaves uncovered of its coarse line, or of one that lies along it for the most part, is tried again as a line
    of its own, MOST_REMAINDERS times at most.
    """
    found: list[Piece] = []
    rejected: list[Rejection] = []
    waiting = [(line.points, line.normals, line.level, MOST_REMAINDERS) for line in coarse]
    while waiting:
        line, normals, level, more = waiting.pop(0)
        whole_line = more == MOST_REMAINDERS
        if level < MIN_LEVEL:
            reason = f"surface at one level on both sides over only {level:.0%} of it, under {MIN_LEVEL:.0%}"
            rejected.append(_rejection(line, reason, sideless=True))
            continue
        if any(_covers(piece, line) for piece in found):
            if more > 0:
                waiting += [(line[run], normals[run], level, more - 1) for run in _own_runs(line, found, 0.8 * config.min_length)]
            continue
        own = _own_part(line, found)
        if arc_length(line[own])[-1] >= 0.8 * config.min_length:
            line, normals = line[own], normals[own]
        fit = grow(atlas, line, normals, config)
        if isinstance(fit, Lost):
            reason, lacks_sides = fit.reason, fit.sides
        else:
            span = seam_span(fit, config)
            lacks_sides = sideless(fit, span, config)
            reason = refusal(fit, span, config)
            piece = Piece(fit, span, whole=reason is None)
            if reason is None or refusal(fit, span, config, piece=True) is None:
                if any(_covers(other, fit.rail.points[station_mask(fit, span)]) for other in found):
                    continue
                found.append(piece)
                if more > 0:
                    left = uncovered(line, fit, span, 0.8 * config.min_length)
                    waiting += [(line[part], normals[part], level, more - 1) for part in left]
        if reason is not None and whole_line:
            rejected.append(_rejection(line, reason, sideless=lacks_sides))
    joined = join_pieces(found, atlas, config)
    whole = _without_doubles([piece for piece in joined if piece.whole], config)
    carried = _without_doubles([carry_on(piece, atlas, config) for piece in whole], config)
    parted = _without_doubles(part_at_branches(carried, atlas, config), config)
    return at_one_window(parted, atlas.cloud.viewpoints, config), rejected


def _without_doubles(pieces: list[Piece], config: ProfileConfig) -> list[Piece]:
    """The pieces without those that lie along a longer one; of one that does so in part, the longest stretch that does not.

    At a junction two lines may each lead through it, and one branch is then a part of both.
    """
    kept: list[Piece] = []
    for piece in sorted(pieces, key=lambda piece: piece.span[0] - piece.span[1]):
        stations = np.flatnonzero(station_mask(piece.fit, piece.span))
        line = piece.fit.rail.points[stations]
        if any(_covers(other, line) for other in kept):
            runs = _own_runs(line, kept, config.min_length)
            if not runs:
                continue
            own = max(runs, key=lambda run: run.stop - run.start)
            step = piece.fit.rail.step
            piece = replace(piece, span=(float(stations[own.start] * step), float(stations[own.stop - 1] * step)))
            if refusal(piece.fit, piece.span, config) is not None:
                continue
        kept.append(piece)
    return kept


def _standings(pieces: list[Piece], atlas: Atlas) -> dict[int, Standing]:
    """How far each piece stands out from its surface, by its id; what may well be a groove is no background of the others."""

    def measured(piece: Piece, others: list[Float[ndarray, "_ 3"]]) -> Standing | None:
        middle = int(np.flatnonzero(station_mask(piece.fit, piece.span)).mean())
        charts = atlas.facing(piece.fit.rail.points[middle], piece.fit.rail.n[middle])
        return standing(piece.fit, piece.span, charts, others)

    alone = [measured(piece, []) for piece in pieces]
    likely = {
        id(piece): lips(piece.fit, piece.span)
        for piece, each in zip(pieces, alone, strict=True)
        if each is not None and each.ratio > LIKELY
    }
    found = {}
    for piece, each in zip(pieces, alone, strict=True):
        others = [places for key, places in likely.items() if key != id(piece)]
        again = measured(piece, others) if others else each
        if again is not None:
            found[id(piece)] = again
    return found


def _confidence(course: Course, stands: dict[int, Standing], config: ProfileConfig) -> float:
    """That of the pieces, weighted by their lengths.

    Args:
        stands: of each piece, by its id.
    """
    length = [piece.span[1] - piece.span[0] for piece in course.pieces]
    each = [confidence(piece.fit, piece.span, config, stands.get(id(piece))) for piece in course.pieces]
    return float(np.average(each, weights=length))


def _merit(course: Course, sure: float) -> float:
    """What puts a seam first: its confidence, and its length as far as more of it is better evidence."""
    return sure * course.length / (course.length + LONG)


def _rejection(line: Float[ndarray, "k 3"], reason: str, doubtful: bool = False, *, sideless: bool = False) -> Rejection:
    x, y, z = line[len(line) // 2].tolist()
    length = float(arc_length(line)[-1])
    return Rejection(position_B=(x, y, z), length=length, reason=reason, doubtful=doubtful, sideless=sideless)


def _covers(piece: Piece, line: Float[ndarray, "k 3"]) -> bool:
    """Whether most of a line lies within a groove already found."""
    return bool(np.mean(_distance(piece, line) < 0.6 * piece.fit.section.width) > 0.5)


def _own_part(line: Float[ndarray, "k 3"], found: list[Piece]) -> slice:
    """A coarse line without the ends that lie along grooves already found: at a junction it may have run on into another."""
    at = np.flatnonzero(_own(line, found))
    return slice(int(at[0]), int(at[-1]) + 1) if len(at) > 1 else slice(0, 1)


def _own_runs(line: Float[ndarray, "k 3"], found: list[Piece], shortest: float) -> list[slice]:
    """The stretches of a coarse line at least `shortest` [m] long that lie along no groove already found."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], _own(line, found).astype(np.int8), [0]])))
    runs = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [run for run in runs if arc_length(line[run])[-1] >= shortest]


def _own(line: Float[ndarray, "k 3"], found: list[Piece]) -> Bool[ndarray, "k"]:
    """Which points of a coarse line lie along no groove already found."""
    own = np.ones(len(line), bool)
    for piece in found:
        own &= _distance(piece, line) >= 0.6 * piece.fit.section.width
    return own


def _distance(piece: Piece, line: Float[ndarray, "k 3"]) -> Float[ndarray, "k"]:
    """Of a line's points from a groove [m]."""
    return project(line, piece.fit.rail.points[station_mask(piece.fit, piece.span)])[0]


def _mark_region(region: Int[ndarray, "n"], number: int, atlas: Atlas, fit: Fit, span: tuple[float, float]) -> None:
    """Write `number` at the points whose sight line enters between the lips of a groove and ends in it.

    What lies far below its bottom is seen through a root gap; what lies in a gap of the seam lies on a clamp or a tack.
    """
    part, cloud = station_mask(fit, span), atlas.cloud
    near = atlas.within_reach(fit.rail.points[part])
    strip = lay_out(fit.rail, cloud.points[near], atlas.sight_origins(near))
    s, x, depth = ray_coordinates(strip, fit.parent)
    inside: Bool[ndarray, "k"] = (np.abs(x) <= fit.section.width / 2) & (s >= span[0]) & (s <= span[1])
    inside &= (depth > -0.004) & (depth < deepest(fit.section))
    for s0, s1 in gaps(fit, span):
        inside &= (s <= s0) | (s >= s1)
    region[near[inside]] = number
