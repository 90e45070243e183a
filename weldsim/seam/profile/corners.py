"""Pieces made one round the edges of a part, and branches led to the point where they meet."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.branches import WIDTHS
from weldsim.seam.profile.course import Course, end_to_end, stretch
from weldsim.seam.profile.ends import station_mask
from weldsim.seam.profile.join import DISTURBED, Piece
from weldsim.seam.profile.meet import MOST_MISS, UNKNOWN_BEND, Corner, End, Meeting, meeting_point, round_corner

READ = 0.040  # [m] of a piece from which the direction of its end is read
SHORTEST = 0.030  # [m] a shorter piece has no direction to be carried on in
CORNER_STEP = 0.0005  # [m] between the points of a corner
ALIKE = 0.55  # of the larger width and depth, the smaller one of two ends at an edge
CLEAR = 1.6  # widths from a junction, within which one branch lies in the strip of another
STEEPEST = 0.9  # cosine between a branch and the groove it runs into

Mark = tuple[int, int]
"""One end of a piece: its index, and 1 for its last station, -1 for its first."""


@dataclass(frozen=True, eq=False)
class Lead:
    """The end of a piece, left off where an edge or another branch may have bent what was seen.

    Attributes:
        end: looking out.  at: arc length [m] on the rail at which it stands.  short: what was left off [m].
    """

    end: End
    at: float
    short: float


@dataclass(frozen=True, eq=False)
class Tail:
    """What a branch is led on by. Attributes: at, where on its rail that begins [m]; course."""

    at: float
    course: Course


def lay_courses(pieces: list[Piece], config: ProfileConfig) -> list[Course]:
    """The courses of all pieces: through every edge of the part that two of them meet at, branches up to where they meet."""
    leads, deeper = (
        {(k, way): lead for k, piece in enumerate(pieces) for way in (-1, 1) if (lead := _lead(piece, way, off)) is not None}
        for off in (DISTURBED, 2 * DISTURBED)
    )
    links = _links(leads, config)
    free = {mark: lead for mark, lead in leads.items() if mark not in links}
    tails = _tails([free, {mark: lead for mark, lead in deeper.items() if mark in free}], pieces)
    tails |= {
        mark: Tail(lead.at, _straight_on(lead, foot))
        for mark, lead in free.items()
        if mark not in tails and (foot := _foot(lead, [piece for k, piece in enumerate(pieces) if k != mark[0]])) is not None
    }
    courses: list[Course] = []
    used: set[int] = set()
    # Chains begin at an end that leads to no other piece; a ring, which has none, at any of its corners.
    starts = [mark for k in range(len(pieces)) for mark in ((k, -1), (k, 1)) if mark not in links]
    for start in [*starts, *((k, -1) for k in range(len(pieces)))]:
        if start[0] not in used:
            courses.append(_walk(start, pieces, leads, links, tails, used))
    return courses


def _walk(
    start: Mark,
    pieces: list[Piece],
    leads: dict[Mark, Lead],
    links: dict[Mark, tuple[Mark, Corner]],
    tails: dict[Mark, Tail],
    used: set[int],
) -> Course:
    """The course from one end of a piece through everything it is linked to."""
    parts: list[Course] = [tails[start].course.reversed()] if start in tails else []
    mark = start
    while True:
        k, way = mark
        used.add(k)
        out = (k, -way)
        cut = {side: tails[k, side].at if (k, side) in tails else pieces[k].span[(side + 1) // 2] for side in (-1, 1)}
        for each in (mark, out):
            if each in links and not (each == start and mark == start):
                cut[each[1]] = leads[each].at
        part = stretch(pieces[k], cut[-1], cut[1])
        parts.append(part if way < 0 else part.reversed())
        if out not in links or links[out][0][0] in used:
            break
        mark, corner = links[out]
        widths = np.array([pieces[k].fit.section.width, pieces[mark[0]].fit.section.width])
        u = np.linspace(0.0, 1.0, len(corner.points))
        steps = np.array([parts[-1].step[-1], -mark[1] * pieces[mark[0]].fit.section.step])
        width, step = (np.interp(u, [0.0, 1.0], each) for each in (widths, steps))
        parts.append(Course(corner.points, corner.normals, corner.sigma, width, step))
    if out in tails:
        parts.append(tails[out].course)
    return end_to_end(parts)


def _lead(piece: Piece, way: int, off: float) -> Lead | None:
    """Where a piece can be carried on from, `off` [m] left off if it is long enough; None where it has no direction."""
    fit, rail = piece.fit, piece.fit.rail
    length = piece.span[1] - piece.span[0]
    if length < SHORTEST:
        return None
    short = min(off, 0.25 * length)
    at = piece.span[1] - short if way > 0 else piece.span[0] + short
    first = int(np.clip(round(at / rail.step), 0, len(rail) - 1))
    index = first - way * np.arange(round(min(READ, length - 2 * short) / rail.step) + 1)
    index = index[(index >= 0) & (index < len(rail))]
    away = np.arange(len(index)) * rail.step
    if len(index) < 4:
        return None
    curve = np.polynomial.polynomial.polyfit(away, rail.points[index], 2)
    sigma = float(fit.sigma[index].mean())
    end = End(
        point=rail.points[first],
        direction=unit(-curve[1]),
        normal=rail.n[first],
        bend=2 * curve[2],
        sigma=sigma,
        turn=4 * sigma / float(away[-1]),
        width=fit.section.width,
        depth=fit.section.depth,
    )
    return Lead(end, first * rail.step, short)


def _comparable(a: End, b: End) -> bool:
    """Whether two ends may be of one groove on two faces: a view blurs it the more, the more it slants; wider or deeper."""
    return min(a.width, b.width) > ALIKE * max(a.width, b.width) and min(a.depth, b.depth) > ALIKE * max(a.depth, b.depth)


def _links(leads: dict[Mark, Lead], config: ProfileConfig) -> dict[Mark, tuple[Mark, Corner]]:
    """For each end that goes on round an edge, where, and the corner that leads there; the nearest ends first."""
    found: list[tuple[float, Mark, Mark, Corner]] = []
    for a, b in combinations(leads, 2):
        one, other = leads[a], leads[b]
        apart = float(np.linalg.norm(one.end.point - other.end.point))
        most = DISTURBED + config.max_filled
        if a[0] == b[0] or apart > 2 * most or not _comparable(one.end, other.end):
            continue
        corner = round_corner(one.end, other.end, config.corner_radius, most, CORNER_STEP)
        if corner is not None:
            found.append((apart, a, b, corner))
    links: dict[Mark, tuple[Mark, Corner]] = {}
    for _, a, b, corner in sorted(found, key=lambda each: each[0]):
        if a not in links and b not in links:
            links[a], links[b] = (b, corner), (a, corner.reversed())
    return links


def _tails(looks: list[dict[Mark, Lead]], pieces: list[Piece]) -> dict[Mark, Tail]:
    """What leads from the ends of branches to the point where three or more of them meet on one surface.

    Args:
        looks: the free ends; then the same with more left off, for where one has run on into another branch.
    """
    tails: dict[Mark, Tail] = {}
    left = dict(looks[0])
    while left:
        mark, lead = left.popitem()
        reach = WIDTHS * lead.end.width
        near = {
            other: each
            for other, each in left.items()
            if other[0] != mark[0] and np.linalg.norm(_tip(each) - _tip(lead)) < reach + WIDTHS * each.end.width
        }
        names = [mark, *near]
        if len({k for k, _ in names}) < 3:
            continue
        for look in looks:
            group = {name: look[name] for name in names if name in look}
            meeting = meeting_point([each.end for each in group.values()]) if len(group) == len(names) else None
            if meeting is not None and all(_off(each, meeting.point) < WIDTHS * each.end.width for each in group.values()):
                group, meeting = _clear_of(meeting, group, pieces)
                tails |= {name: Tail(each.at, _led_to(each, meeting)) for name, each in group.items()}
                left = {name: each for name, each in left.items() if name not in names}
                break
    return tails


def _clear_of(meeting: Meeting, group: dict[Mark, Lead], pieces: list[Piece]) -> tuple[dict[Mark, Lead], Meeting]:
    """Leads that stand where no branch disturbs another, and where these meet; as they were where that is nowhere."""
    clear: dict[Mark, Lead] = {}
    for mark, lead in group.items():
        before = float((meeting.point - _tip(lead)) @ lead.end.direction)
        apart = _lead(pieces[mark[0]], mark[1], max(lead.short, CLEAR * lead.end.width - before))
        clear[mark] = lead if apart is None else apart
    again = meeting_point([lead.end for lead in clear.values()])
    return (group, meeting) if again is None else (clear, again)


def _foot(lead: Lead, others: list[Piece]) -> Float[ndarray, "3"] | None:
    """The point [m] at which a branch, carried straight on, meets the line of another groove, or None."""
    end = lead.end
    for other in others:
        rail, inside = other.fit.rail, station_mask(other.fit, other.span)
        points, along = rail.points[inside], rail.t[inside]
        way = points - end.point
        ahead = way @ end.direction
        off = np.linalg.norm(way - ahead[:, None] * end.direction, axis=1)
        reach = WIDTHS * max(end.width, other.fit.section.width)
        near = (np.abs(ahead - lead.short) < reach) & (ahead > 0)
        if not near.any():
            continue
        k = int(np.where(near, off, np.inf).argmin())
        crosses = abs(float(along[k] @ end.direction)) < STEEPEST
        if 0 < k < len(points) - 1 and crosses and off[k] < MOST_MISS * end.width:
            return points[k]
    return None


def _tip(lead: Lead) -> Float[ndarray, "3"]:
    """Where the piece itself ended [m]."""
    return lead.end.point + lead.short * lead.end.direction


def _off(lead: Lead, point: Float[ndarray, "3"]) -> float:
    """How far before or behind a point a piece ended [m]."""
    return abs(float((point - _tip(lead)) @ lead.end.direction))


def _led_to(lead: Lead, meeting: Meeting) -> Course:
    """The straight course from a lead to where branches meet, known the better the more of them do."""
    end = lead.end
    return _straight_on(lead, meeting.point, meeting.sigma(end.direction, end.normal))


def _straight_on(lead: Lead, middle: Float[ndarray, "3"], sigma: float | None = None) -> Course:
    """The straight course from a lead to a point [m].

    Args:
        sigma: standard deviation of the point across the course [m]; where it is None, as the lead's direction leaves it.
    """
    end, way = lead.end, middle - lead.end.point
    length = float(np.linalg.norm(way))
    number = max(2, int(np.ceil(length / 0.001)) + 1)
    u = np.linspace(0.0, 1.0, number)
    if sigma is None:
        deviation = np.hypot(end.sigma, u * length * end.turn)
    else:
        bend = 0.5 * u * (1.0 - u) * length**2 * UNKNOWN_BEND
        deviation = np.sqrt(((1.0 - u) * end.sigma) ** 2 + (u * sigma) ** 2 + bend**2)
    return Course(
        points=end.point + u[:, None] * way,
        normals=np.repeat(end.normal[None], number, 0),
        sigma=deviation,
        width=np.full(number, end.width),
        step=np.zeros(number),  # where branches meet, their plates are one
    )
