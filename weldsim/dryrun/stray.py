"""Waypoints that lie aside of an otherwise smooth line: a slip that a motion can follow all the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.scatter import distinct, position_scatter
from weldsim.records import TorchPath

FEWEST, FEW = 5, 30  # waypoints that make a line; that are so few that one of them counts
COUNTED = 7  # waypoints of which scatter can be told
LEAST = 0.002  # [m] aside that is told
SCATTERS = 10.0  # standard deviations of the waypoints that a stray is off at least
DIRECTION = 20.0  # standard deviations of the waypoints apart: places that tell a direction, to 4 deg
BACK = 6.0  # standard deviations that a short end is off the line before it
SMOOTH = np.deg2rad(40.0)  # by which the line may turn beside a stray, the stray left out
NEARLY = 0.6  # of the least distance: what is no nearer to its neighbours' middle is looked at
OUTSTANDING = 6.0  # times as far aside as the line's own bend would put it: corners come to 4 at most
EVEN, STEP = 0.005, (0.8, 1.25)  # of a step: what an end that is aside is along the line; the latter of one over a step aside
CORNERS = 3  # of the line in which an end is aside: more are a weave
MOST = (2, 20)  # strays; one in so many waypoints: more of them are a pattern


@dataclass(frozen=True, kw_only=True)
class Stray:
    """Attributes: index of the waypoint; aside, how far it is from the line through its neighbours [m]."""

    index: int
    aside: float


def strays(path: TorchPath) -> list[Stray]:
    """The waypoints that lie aside of the line through the others, where these go on smoothly without them.

    A corner turns the line and is none; nor are weaves, steps and whatever else comes again and again.
    """
    places = distinct(path)
    p = path.X_BT.p[places]
    if len(p) < FEWEST:
        return []
    if len(p) > FEW:
        found = _found(p, range(len(p)), position_scatter(p))
    else:  # among so few a stray counts as scatter itself
        found = [one for i in range(len(p)) for one in _found(p, [i], _scatter_of_few(np.delete(p, i, axis=0)))]
    return [Stray(index=int(places[i]), aside=off) for i, off in found] if len(found) <= max(MOST[0], len(p) // MOST[1]) else []


def _scatter_of_few(p: Float[ndarray, "n 3"]) -> float:
    """The scatter of places [m]; of so few that it cannot be told the most that any is off the middle of its neighbours."""
    if len(p) >= COUNTED:
        return position_scatter(p)
    chord, leg = p[2:] - p[:-2], p[1:-1] - p[:-2]
    return float((np.linalg.norm(np.cross(chord, leg), axis=1) / np.maximum(np.linalg.norm(chord, axis=1), 1e-12)).max())


def _found(p: Float[ndarray, "n 3"], wanted: Sequence[int], sigma: float) -> list[tuple[int, float]]:
    """Which of the wanted places are aside, and by how much [m]. Args: sigma, the scatter of all places [m]."""
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    line, out = _Line(p, sigma, float(np.median(steps))), []
    least = max(LEAST, SCATTERS * sigma)
    # Nothing is further from the line than from the middle of its neighbours, but for their scatter.
    middle = np.concatenate([[np.inf], np.linalg.norm(p[1:-1] - (p[:-2] + p[2:]) / 2, axis=1), [np.inf]])
    for i in (i for i in wanted if middle[i] > NEARLY * least):
        off = line.aside(i) if 0 < i < len(p) - 1 else line.aside_at_end(last=i > 0)
        if off > least:
            out.append((i, off))
    return out


class _Line:
    """The line of places p [m], which scatter by sigma [m] and are a step apart, the median [m]."""

    def __init__(self, p: Float[ndarray, "n 3"], sigma: float, step: float) -> None:
        self.p, self.sigma, self.step, self.least = p, sigma, step, DIRECTION * sigma

    def aside(self, i: int) -> float:
        """Distance of an inner place from the line through its neighbours [m]; 0 where that does not go on smoothly without it."""
        before, after = self._walk(i, -1), self._walk(i, 1, self.p[i - 1])
        if min(len(before), len(after)) < 2 and self._corners(np.delete(self.p, i, axis=0)) > CORNERS:
            return 0.0
        b = self.p[before[0]]
        if not after:  # what follows is so short that it tells no direction
            return self._aside_of_what_was(i, before)
        c = self.p[after[0]]
        chord = c - b
        length = float(np.linalg.norm(chord))
        turns = [_angle(b - self.p[k], chord) for k in before[1:2]] + [_angle(chord, self.p[k] - c) for k in after[1:2]]
        if length == 0.0 or max(turns, default=np.pi) > SMOOTH:
            return 0.0
        off = float(np.linalg.norm(np.cross(chord, self.p[i] - b))) / length
        # On a circle the place halfway between two is a sixth of their distance times the turn at each off their chord.
        return off if off > OUTSTANDING * length * float(np.mean(turns)) / 6.0 else 0.0

    def _aside_of_what_was(self, i: int, before: list[int]) -> float:
        """The same from the line that led to the place, to which the next ones come back."""
        if len(before) < 2:
            return 0.0
        chord = self.p[before[0]] - self.p[before[1]]
        off = np.linalg.norm(np.cross(chord, self.p[i:] - self.p[before[0]]), axis=1) / np.linalg.norm(chord)
        return float(off[0]) if off[1:].max() < BACK * self.sigma else 0.0

    def aside_at_end(self, last: bool) -> float:
        """The same for the first or last place, from the line through the next; 0 too where it may end a leg of its own."""
        p = self.p[::-1] if last else self.p
        legs, bends = self._legs(p[1:])
        if len(bends) < 2 or bends[:2].max() > SMOOTH or self._corners(p[1:]) > CORNERS:
            return 0.0
        length = float(np.linalg.norm(legs[0]))
        away = p[1] - p[0]
        along = float(away @ legs[0]) / length
        off = float(np.linalg.norm(np.cross(legs[0], away))) / length
        even = abs(along - self.step) < EVEN * self.step + 3.0 * self.sigma
        longer = STEP[0] * self.step < along < STEP[1] * self.step and off > self.step
        return off if (even or longer) and off > OUTSTANDING * self.step * bends[:2].max() else 0.0

    def _legs(self, p: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "l 3"], Float[ndarray, "b"]]:
        """Straight lines from place to place, long enough to tell a direction, and the angles between them."""
        kept = [0]
        for k in range(1, len(p)):
            if np.linalg.norm(p[k] - p[kept[-1]]) >= self.least:
                kept.append(k)
        legs = np.diff(p[kept], axis=0)
        return legs, np.array([_angle(a, b) for a, b in pairwise(legs)])

    def _corners(self, p: Float[ndarray, "n 3"]) -> int:
        return int((self._legs(p)[1] > SMOOTH).sum())

    def _walk(self, i: int, way: int, whence: Float[ndarray, "3"] | None = None) -> list[int]:
        """Two places before (-1) or after (1) a place, so far apart that they tell a direction, and the first from `whence`."""
        out: list[int] = []
        near = whence
        for k in range(i + way, len(self.p) if way > 0 else -1, way):
            if near is None or np.linalg.norm(self.p[k] - near) >= self.least:
                out.append(k)
                near = self.p[k]
                if len(out) == 2:
                    break
        return out


def _angle(a: Float[ndarray, "3"], b: Float[ndarray, "3"]) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
