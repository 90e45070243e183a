"""Whether two ends of grooves are the two banks of one gap, or of one corner, and the line that leads across."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.curves import arc_length
from weldsim.frames import unit

UNKNOWN_BEND = 4.0  # [1/m] by which a groove's curvature may change unseen
SLACK = 0.0005  # [m] between two pieces' ends, each fitted by itself
TURN_SLACK = 0.05  # [rad] between their directions
SIGMAS = 3.0
MOST_TURN = 0.5  # [rad] between the carried-on directions, however uncertain they are
MOST_LEAN = 0.35  # [rad] between the normals of two ends on one surface, not counting what the line itself bends
DEFAULT_STEP = 0.001  # [m] spacing of a corner's points
MOST_MISS = 0.25  # of the width, by which lines may miss each other at an edge: each face has its own view, seen from elsewhere
LEAST_EDGE = 0.25  # [rad] between two faces; less is a bend or a warp of one
PARALLEL = 0.1  # sine of the angle below which two lines have no corner


@dataclass(frozen=True, eq=False)
class End:
    """One end of a fitted groove, looking out of it.

    Attributes:
        point: (3,) [m].  direction: (3,) unit, outward along the groove.  normal: (3,) unit, outward of the parent surface.
        bend: (3,) curvature vector with which the groove arrives [1/m].
        sigma: standard deviation of the point across the seam [m].  turn: of the direction [rad].
        width, depth: of the groove's section [m].
        skipped: length before the end over which it was carried on unread [m].
    """

    point: Float[ndarray, "3"]
    direction: Float[ndarray, "3"]
    normal: Float[ndarray, "3"]
    bend: Float[ndarray, "3"]
    sigma: float
    turn: float
    width: float
    depth: float
    skipped: float = 0.0

    def carried(self, d: float) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
        """Point [m] and direction a distance d [m] farther out, as the end bends."""
        return self.point + d * self.direction + 0.5 * d**2 * self.bend, unit(self.direction + d * self.bend)

    def doubt(self, d: float) -> tuple[float, float]:
        """Standard deviation of that point across the seam [m] and of that direction [rad]."""
        unread = self.skipped + d
        across = np.hypot(np.hypot(self.sigma, d * self.turn), 0.5 * unread**2 * UNKNOWN_BEND)
        return float(across), float(np.hypot(self.turn, unread * UNKNOWN_BEND))


@dataclass(frozen=True, eq=False)
class Corner:
    """The rounded way from one face to the next.

    Attributes:
        points: (k, 3) from the end of one groove to that of the other [m].  normals: (k, 3) unit, outward.
        sigma: (k,) standard deviation of the line [m].
        corner: (3,) where the two lines, carried on, meet [m].
    """

    points: Float[ndarray, "k 3"]
    normals: Float[ndarray, "k 3"]
    sigma: Float[ndarray, "k"]
    corner: Float[ndarray, "3"]

    def reversed(self) -> "Corner":
        """The same way, travelled from the second groove to the first."""
        return Corner(self.points[::-1], self.normals[::-1], self.sigma[::-1], self.corner)


def alike(a: End, b: End) -> bool:
    """Whether two ends show sections of one size, as well as a short blurred piece tells."""
    wide, narrow = max(a.width, b.width), min(a.width, b.width)
    deep, shallow = max(a.depth, b.depth), min(a.depth, b.depth)
    return wide - narrow < max(0.3 * wide, 0.002) and shallow > 0.5 * deep


def faces(a: End, b: End, max_gap: float) -> bool:
    """Whether two ends on one surface face each other and, carried on to the middle, meet within their uncertainty.

    Position and direction are tried; the parent surface has to bend no more than its line and MOST_LEAN.

    Args:
        max_gap: most that may lie between them [m].
    """
    chord = b.point - a.point
    gap = float(np.linalg.norm(chord))
    if gap > max_gap or float(a.direction @ b.direction) > -0.5:
        return False
    if gap > a.width / 4 and min(float(a.direction @ chord), -float(b.direction @ chord)) < 0.5 * gap:
        return False
    half = 0.5 * float(np.clip(a.direction @ chord, 0.0, gap))
    (here, way), (there, back) = a.carried(half), b.carried(half)
    along = unit(way - back)
    miss = here - there
    off = float(np.linalg.norm(miss - (miss @ along) * along))
    turned = float(np.arccos(np.clip(-way @ back, -1.0, 1.0)))
    (near, near_turn), (far, far_turn) = a.doubt(half), b.doubt(half)
    allowed = min(SLACK + SIGMAS * np.hypot(near, far), 0.5 * min(a.width, b.width))
    may_turn = min(TURN_SLACK + SIGMAS * np.hypot(near_turn, far_turn), MOST_TURN)
    bends = float(np.arccos(np.clip(-a.direction @ b.direction, -1.0, 1.0)))
    leans = float(np.arccos(np.clip(a.normal @ b.normal, -1.0, 1.0)))
    return bool(off < allowed and turned < may_turn and leans < MOST_LEAN + bends)


def lead_across(a: End, b: End, step: float) -> tuple[Float[ndarray, "k 3"], Float[ndarray, "k 3"]]:
    """Points [m] and unit normals of the smooth curve (cubic Hermite) from one end to the other, both left out."""
    gap = float(np.linalg.norm(b.point - a.point))
    u = np.linspace(0.0, 1.0, max(2, int(np.ceil(gap / step)) + 1))[1:-1, None]
    ends = (2 * u**3 - 3 * u**2 + 1) * a.point + (3 * u**2 - 2 * u**3) * b.point
    ways = (u**3 - 2 * u**2 + u) * a.direction - (u**3 - u**2) * b.direction
    return ends + gap * ways, unit((1 - u) * a.normal + u * b.normal)


def round_corner(a: End, b: End, radius: float, max_gap: float, step: float = DEFAULT_STEP) -> Corner | None:
    """The way round a convex edge between the faces of two ends, or None where their lines do not meet there.

    Each line goes straight on to the corner; there it is rounded by an arc of `radius` tangent to both, in their plane,
    its normals turning evenly from one face's to the other's. The standard deviation grows with the distance from the
    end that each point is carried from.

    Args:
        radius: of the rounding of the line [m].  max_gap: most that each line is carried on [m].
        step: most between two points [m].
    """
    cross = np.cross(a.direction, b.direction)
    if float(np.linalg.norm(cross)) < PARALLEL:
        return None
    if float(a.normal @ b.normal) > np.cos(LEAST_EDGE):
        return None
    # Convex: either end lies behind the other's face, and the lines run towards each other.
    chord = b.point - a.point
    if float(chord @ a.normal) >= 0 or float(chord @ b.normal) <= 0:
        return None
    out_a, out_b = np.linalg.lstsq(np.stack([a.direction, -b.direction], axis=1), chord, rcond=None)[0].tolist()
    if not (0 <= out_a <= max_gap and 0 <= out_b <= max_gap):
        return None
    foot_a, foot_b = a.point + out_a * a.direction, b.point + out_b * b.direction
    near = float(np.hypot(a.sigma, out_a * a.turn))
    far = float(np.hypot(b.sigma, out_b * b.turn))
    allowed = max(SLACK + SIGMAS * float(np.hypot(near, far)), MOST_MISS * min(a.width, b.width))
    if float(np.linalg.norm(foot_a - foot_b)) > allowed:
        return None
    share = near**2 / max(near**2 + far**2, 1e-18)
    corner = foot_a + share * (foot_b - foot_a)
    turn = float(np.arccos(np.clip(-a.direction @ b.direction, -1.0, 1.0)))
    cut = radius * np.tan(turn / 2)
    if cut > min(out_a, out_b):
        return None
    begin, finish = corner - cut * a.direction, corner - cut * b.direction
    inward = unit((b.direction @ a.direction) * a.direction - b.direction)
    angle = np.linspace(0.0, turn, max(2, int(np.ceil(radius * turn / step)) + 1))[:, None]
    arc = begin + radius * (np.sin(angle) * a.direction + (1 - np.cos(angle)) * inward)
    points = np.concatenate([_straight(a.point, begin, step), arc, _straight(b.point, finish, step)[::-1]])
    s = arc_length(points)
    on_arc = np.clip((s - s[0] - (out_a - cut)) / max(radius * turn, 1e-12), 0.0, 1.0)[:, None]
    normals = _turned(a.normal, b.normal, on_arc)
    first, second = np.hypot(a.sigma, s * a.turn), np.hypot(b.sigma, (s[-1] - s) * b.turn)
    u = on_arc[:, 0]
    return Corner(points, normals, np.sqrt((1 - u) * first**2 + u * second**2), corner)


@dataclass(frozen=True, eq=False)
class Meeting:
    """Attributes: point (3,), that the lines of several ends pass through [m]; covariance (3, 3) of it [m^2]."""

    point: Float[ndarray, "3"]
    covariance: Float[ndarray, "3 3"]

    def sigma(self, direction: Float[ndarray, "3"], normal: Float[ndarray, "3"]) -> float:
        """Standard deviation [m] of the point across a line of that direction on a surface of that normal."""
        across = unit(np.cross(normal, direction))
        return float(np.sqrt(across @ self.covariance @ across))


def meeting_point(ends: list[End]) -> Meeting | None:
    """Where the lines of several ends on one surface meet, each straight on, or None where one of them misses that point by
    more than MOST_MISS of its width, or faces another way."""
    if min(float(a.normal @ b.normal) for a in ends for b in ends) < np.cos(MOST_LEAN):
        return None
    rough = _nearest_to_all(ends, np.array([end.sigma for end in ends]))
    if rough is None:
        return None
    # How far each has to go is told by where they meet.
    far = [float((rough.point - end.point) @ end.direction) for end in ends]
    meeting = _nearest_to_all(ends, np.array([np.hypot(end.sigma, end.turn * d) for end, d in zip(ends, far, strict=True)]))
    if meeting is None:
        return None
    for end in ends:
        way = meeting.point - end.point
        if float(np.linalg.norm(way - (way @ end.direction) * end.direction)) > MOST_MISS * end.width or way @ end.direction < 0:
            return None
    return meeting


def _nearest_to_all(ends: list[End], sigma: Float[ndarray, "k"]) -> Meeting | None:
    """The point with the least weighted sum of squared distances from straight lines, or None where they are parallel."""
    across = [(np.eye(3) - np.outer(end.direction, end.direction)) / each**2 for end, each in zip(ends, sigma, strict=True)]
    total = np.sum(across, axis=0)
    if np.linalg.cond(total) > 1e3:
        return None
    point = np.linalg.solve(total, np.sum([each @ end.point for each, end in zip(across, ends, strict=True)], axis=0))
    return Meeting(point, np.linalg.inv(total))


def _straight(start: Float[ndarray, "3"], stop: Float[ndarray, "3"], step: float) -> Float[ndarray, "k 3"]:
    """Points from start towards stop, which is left out."""
    number = max(1, int(np.ceil(np.linalg.norm(stop - start) / step)))
    return start + np.arange(number)[:, None] / number * (stop - start)


def _turned(a: Float[ndarray, "3"], b: Float[ndarray, "3"], u: Float[ndarray, "k 1"]) -> Float[ndarray, "k 3"]:
    """Unit vectors turned evenly from a (u = 0) to b (u = 1)."""
    angle = float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
    if angle < 1e-6:
        return unit((1 - u) * a + u * b)
    return (np.sin((1 - u) * angle) * a + np.sin(u * angle) * b) / np.sin(angle)
