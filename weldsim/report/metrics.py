"""Figures of a line against the known seam: pure functions, each with the one definition it uses.

Offsets are taken at the perpendicular foot on the known line. Beyond the known ends the line goes on straight along its
end tangents, so a line that stops short or runs on is charged in the end errors and the coverage, never as cross-track
error. Lines are resampled evenly before statistics are taken, so figures are weighted by arc length and do not depend
on how a line was sampled. No figure of seam error means anything without its reference: every function says which.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.curves import arc_length, interpolate, project, tangents
from weldsim.frames import unit
from weldsim.quantity import Metre
from weldsim.records import KnownSeam, LineError, Reference, Seam

STEP: Metre = 0.5e-3  # between samples of a line when statistics are taken
NEAR: Metre = 3e-3  # a known point is covered where the line passes within this of it
SHARP = 0.3  # [rad] between samples of the known seam: more is a corner
TURN: Metre = 25e-3  # about a corner of the known seam the wire may point anywhere between both sides' bisectors
MATCH: Metre = 5e-3  # a found seam belongs to a known one where it lies within this of it


@dataclass(frozen=True, eq=False, kw_only=True)
class Offsets:
    """Where points lie with respect to a line.

    Attributes:
        s: (n,) arc length of the perpendicular foot [m]; negative before the line's start, beyond its length after its end.
        distance: (n,) perpendicular distance in space [m].
        vectors: (n, 3) from foot to point [m].
    """

    s: Float[ndarray, "n"]
    distance: Float[ndarray, "n"]
    vectors: Float[ndarray, "n 3"]


@dataclass(frozen=True, kw_only=True)
class SeamMatch:
    """Which found seam is which known seam.

    Attributes:
        pairs: (found, known) indices, one for each known seam that was found.
        fragments: found seams that lie on a known seam which a longer one already stands for.
        phantoms: found seams that are no seam.  missed: known seams that nothing stands for.
        phantom_length: total length of the phantoms [m].
        owners: for each found seam, the known seam on which it lies; -1 for a phantom.
    """

    pairs: tuple[tuple[int, int], ...]
    fragments: tuple[int, ...]
    phantoms: tuple[int, ...]
    missed: tuple[int, ...]
    phantom_length: float
    owners: tuple[int, ...]


def known_line(known: KnownSeam, reference: Reference = "opening") -> Float[ndarray, "n 3"]:
    """The line of the known seam that `reference` names [m]; the middle of the gap is the middle of the lips."""
    return known.root_B if reference == "root" else known.opening_B


def offsets(points: Float[ndarray, "m 3"], line: Float[ndarray, "n 3"], ends: Float[ndarray, "2 3"] | None = None) -> Offsets:
    """Perpendicular offsets of points from a line that goes on straight beyond both ends.

    Args:
        points: in the frame of `line` [m].
        line: polyline [m].
        ends: unit tangents at the first and last point, when known better than from the polyline.
    """
    _, foot, s = project(points, line)
    length = arc_length(line)[-1]
    t = tangents(line)[[0, -1]] if ends is None else ends
    for end, anchor, at, sign in ((0, line[0], 0.0, -1.0), (1, line[-1], length, 1.0)):
        along = (points - anchor) @ t[end]
        beyond = (np.abs(s - at) < 1e-12) & (along * sign > 0)
        foot[beyond] = anchor + along[beyond, None] * t[end]
        s[beyond] = at + along[beyond]
    vectors = points - foot
    return Offsets(s=s, distance=np.linalg.norm(vectors, axis=1), vectors=vectors)


def known_offsets(points_B: Float[ndarray, "m 3"], known: KnownSeam, reference: Reference = "opening") -> Offsets:
    """Offsets of points from the known seam, with its tangents in closed form beyond the ends; a ring has none."""
    line = known_line(known, reference)
    found = offsets(points_B, line, known.tangents_B[[0, -1]])
    return replace(found, s=found.s % arc_length(line)[-1]) if known.closed else found


def across(found: Offsets, known: KnownSeam, reference: Reference = "opening") -> Float[ndarray, "m"]:
    """The part of each offset that lies across the seam in the parent surface, positive to the left of travel [m]."""
    length = arc_length(known_line(known, reference))
    left = unit(np.cross(-known.bisectors_B, known.tangents_B))
    return np.einsum("ij,ij->i", found.vectors, unit(interpolate(length, left, found.s)))


def line_error(
    points_B: Float[ndarray, "n 3"],
    wire_axes_B: Float[ndarray, "n 3"],
    known: KnownSeam,
    reference: Reference = "opening",
    trims: tuple[Metre, Metre] = (0.0, 0.0),
) -> LineError:
    """How far a line is from the known seam, whichever way it runs.

    Cross-track distance is the perpendicular distance in space (see `offsets`); mean, rms, p95 and max are over samples
    every 0.5 mm. Coverage is the fraction of the length asked for (the known one without the trims) whose perpendicular
    foot the line passes within 3 mm. End errors are along the seam, at the start and end of what was asked for, positive
    where the line runs on; a ring has no known start, and its end error is the overlap. The axis angle is between wire
    axis and the known inward bisector at the foot; within 25 mm of a corner of the known seam, which a line must round, it
    is to the nearest direction between the bisectors of both sides.

    Args:
        points_B: the line [m], two points or more.  wire_axes_B: unit, towards the work.
        known: the true seam.  reference: which line of it is compared.
        trims: length left out on purpose at the line's start and end, as it runs [m].
    """
    points, axes = _even(points_B, wire_axes_B)
    line = known_line(known, reference)
    found = known_offsets(points, known, reference)
    s = arc_length(line)
    length = float(s[-1])
    if known.closed:
        found = replace(found, s=np.unwrap(found.s, period=length))
    if found.s[-1] < found.s[0]:
        points, axes, trims = points[::-1], axes[::-1], (trims[1], trims[0])
        found = Offsets(s=found.s[::-1], distance=found.distance[::-1], vectors=found.vectors[::-1])
    low, high = (0.0, length - sum(trims)) if known.closed else (trims[0], length - trims[1])
    first, last = float(found.s[0]), float(found.s[-1])
    angle = axis_angle(axes, found.s % length if known.closed else found.s, s, known.bisectors_B)
    return LineError(
        mean=float(found.distance.mean()),
        rms=float(np.sqrt(np.mean(found.distance**2))),
        p95=float(np.percentile(found.distance, 95)),
        max=float(found.distance.max()),
        coverage=coverage(found, low, high, ring=length if known.closed else None),
        start=0.0 if known.closed else low - first,
        end=last - first - high if known.closed else last - high,
        axis_median=float(np.median(angle)),
        axis_p95=float(np.percentile(angle, 95)),
        reference=reference,
        closed=known.closed,
    )


def axis_angle(
    axes: Float[ndarray, "m 3"], at: Float[ndarray, "m"], s: Float[ndarray, "n"], bisectors: Float[ndarray, "n 3"]
) -> Float[ndarray, "m"]:
    """Angles [rad] between wire axes and the known bisectors at arc lengths `at`, corners as `line_error` says."""
    angle = _between(axes, unit(interpolate(s, bisectors, at)))
    for turn in np.flatnonzero(_between(bisectors[:-1], bisectors[1:]) > SHARP):
        near = np.flatnonzero((at >= s[turn] - TURN) & (at <= s[turn + 1] + TURN))
        # The known seam may hold one sample in the corner itself, between the bisectors of both sides.
        before, after = bisectors[max(turn - 1, 0)], bisectors[min(turn + 2, len(s) - 1)]
        blend = np.linspace(0.0, 1.0, 91)[:, None]
        for direction in unit((1.0 - blend) * before + blend * after):
            angle[near] = np.minimum(angle[near], _between(axes[near], direction[None]))
    return angle


def _between(a: Float[ndarray, "#m 3"], b: Float[ndarray, "#m 3"]) -> Float[ndarray, "k"]:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def coverage(found: Offsets, low: Metre, high: Metre, *, ring: Metre | None = None, near: Metre = NEAR) -> float:
    """The fraction of a line between arc lengths `low` and `high` that consecutive samples, both within `near`, sweep.

    On a ring of length `ring` it does not matter where: the length swept is compared with `high` - `low`.
    """
    if high <= low:
        return 1.0
    close = (found.distance[:-1] <= near) & (found.distance[1:] <= near)
    # A jump of the foot (a line that cuts across a bend) covers nothing in between.
    close &= np.abs(np.diff(found.s)) <= 4 * STEP
    start, end = (pick(found.s[:-1], found.s[1:])[close] for pick in (np.minimum, np.maximum))
    if ring is None:
        start, end = np.clip(start, low, high), np.clip(end, low, high)
    else:
        rounds = np.floor(start / ring) * ring
        start, end = start - rounds, end - rounds
        over = end > ring
        start, end = np.append(start, np.zeros(int(over.sum()))), np.append(np.minimum(end, ring), end[over] - ring)
    if len(start) == 0:
        return 0.0
    order = np.argsort(start)
    start, end = start[order], np.maximum.accumulate(end[order])
    gaps = np.clip(start[1:] - end[:-1], 0.0, None).sum()
    return float(np.clip((end[-1] - start[0] - gaps) / (high - low), 0.0, 1.0))


def match_seams(found: tuple[Seam, ...], known: tuple[KnownSeam, ...], within: Metre = MATCH, share: float = 0.5) -> SeamMatch:
    """Pairs, phantoms and misses.

    A found seam is a phantom when less than `share` of its length lies within `within` of any known seam (ends
    included: running on past a known end counts against it). Otherwise it belongs to the known seam nearest to most of
    it; of several the longest is the pair and the others are fragments.
    """
    near = np.zeros((len(found), len(known)))
    phantoms = []
    for i, seam in enumerate(found):
        points, _ = _even(seam.points_B, seam.normals_B)
        distance = (
            np.stack([project(points, known_line(k, seam.reference))[0] for k in known]) if known else np.zeros((0, len(points)))
        )
        near[i] = (distance <= within).mean(axis=1) if known else near[i]
        if not known or (distance <= within).any(axis=0).mean() < share:
            phantoms.append(i)
    pairs, fragments = {}, []
    for i in sorted((i for i in range(len(found)) if i not in phantoms), key=lambda i: -found[i].length):
        j = int(near[i].argmax())
        if j in pairs:
            fragments.append(i)
        else:
            pairs[j] = i
    return SeamMatch(
        pairs=tuple(sorted((i, j) for j, i in pairs.items())),
        fragments=tuple(sorted(fragments)),
        phantoms=tuple(phantoms),
        missed=tuple(j for j in range(len(known)) if j not in pairs),
        phantom_length=float(sum(found[i].length for i in phantoms)),
        owners=tuple(-1 if i in phantoms else int(near[i].argmax()) for i in range(len(found))),
    )


def sigma_coverage(
    points_B: Float[ndarray, "n 3"], sigma: Float[ndarray, "n"], known: KnownSeam, reference: Reference = "opening"
) -> tuple[float, float]:
    """The fraction of points whose error across the seam is within 1 and within 2 of their own sigma (honest: 0.68, 0.95)."""
    error = np.abs(across(known_offsets(points_B, known, reference), known, reference))
    return float((error <= sigma).mean()), float((error <= 2 * sigma).mean())


def region_overlap(found: Bool[ndarray, "n"], true: Bool[ndarray, "n"]) -> float:
    """Intersection over union: points in both regions over points in either; 1 when both are empty."""
    either = int((found | true).sum())
    return float((found & true).sum()) / either if either else 1.0


def _even(points: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "m 3"], Float[ndarray, "m 3"]]:
    """Points every `STEP` of the polyline, and unit axes there; repeated points are left out."""
    s = arc_length(points)
    keep = np.concatenate([[True], np.diff(s) > 0])
    s, points, axes = s[keep], points[keep], axes[keep]
    at = np.linspace(0.0, s[-1], max(2, int(np.ceil(s[-1] / STEP)) + 1))
    return interpolate(s, points, at), unit(interpolate(s, axes, at))
