"""A smooth curve on the parent surface with a frame at every station: the rail a groove is measured along."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from weldsim.curves import arc_length, interpolate, tangents
from weldsim.frames import unit

ROUNDING = 1e-3  # of a step that a rail may lack to hold another station: most are a whole number of steps long
SHARPEST = 1 / 0.20  # [1/m] the curvature with which a rail is carried on at most: an end is known from one side only


@dataclass(frozen=True, eq=False)
class Rail:
    """Attributes:
    points: (m, 3) evenly spaced stations [m].
    t, e, n: (m, 3) unit axes: along travel, to the left (n x t), outward normal of the parent surface.
    step: spacing of the stations [m].
    """

    points: Float[ndarray, "m 3"]
    t: Float[ndarray, "m 3"]
    e: Float[ndarray, "m 3"]
    n: Float[ndarray, "m 3"]
    step: float

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Strip:
    """Points in a rail's coordinates.

    Attributes:
        station: (k,) nearest station of each point.
        s: (k,) arc length from station 0 [m].  x: (k,) to the left [m].  h: (k,) along the outward normal [m].
        slope: (k, 2) sight line's drift along (t, e) for each metre it goes inward; zero where the viewpoint is unknown.
        above: (k,) height of the viewpoint above the parent plane [m]; infinity where unknown.
    """

    station: Int[ndarray, "k"]
    s: Float[ndarray, "k"]
    x: Float[ndarray, "k"]
    h: Float[ndarray, "k"]
    slope: Float[ndarray, "k 2"]
    above: Float[ndarray, "k"]

    def select(self, chosen: Int[ndarray, "j"]) -> "Strip":
        """The points of those indices."""
        return Strip(*(values[chosen] for values in (self.station, self.s, self.x, self.h, self.slope, self.above)))


def make_rail(points: Float[ndarray, "k 3"], normals: Float[ndarray, "k 3"], step: float, extend: float = 0.0) -> Rail:
    """A rail through a smooth polyline, resampled at `step` and lengthened by `extend` [m] as its ends bend.

    Args:
        points: (k, 3) ordered [m].  normals: (k, 3) outward, roughly.
    """
    if extend > 0:
        head, tail = _onward(points[::-1], step, extend)[::-1], _onward(points, step, extend)
        points = np.concatenate([head, points, tail])
        normals = np.concatenate([np.repeat(normals[:1], len(head), 0), normals, np.repeat(normals[-1:], len(tail), 0)])
    s = arc_length(points)
    at = np.arange(0.0, s[-1] + ROUNDING * step, step)
    even = interpolate(s, points, at)
    return _with_axes(even, interpolate(s, normals, at), step)


def _onward(points: Float[ndarray, "k 3"], step: float, extend: float) -> Float[ndarray, "j 3"]:
    """Points that carry a polyline on past its last one by `extend` [m], with the direction and curvature of its end."""
    s = arc_length(points)
    s = s - s[-1]
    reach = min(-s[0], 0.020)
    marks = interpolate(s, points, np.array([-reach, -0.8 * reach, -0.2 * reach, 0.0]))
    before, last = unit(marks[1] - marks[0]), unit(marks[3] - marks[2])
    bend = (last - before) / (0.8 * reach)
    bend = bend * min(1.0, SHARPEST / max(float(np.linalg.norm(bend)), 1e-9))
    d = np.arange(1, int(np.ceil(extend / step)) + 1)[:, None] * step
    return points[-1] + d * (last + 0.1 * reach * bend) + 0.5 * d**2 * bend


def _with_axes(points: Float[ndarray, "m 3"], normals: Float[ndarray, "m 3"], step: float) -> Rail:
    t = tangents(points)
    e = unit(np.cross(normals, t))
    return Rail(points, t, e, np.cross(t, e), step)


def shift_rail(rail: Rail, x: Float[ndarray, "m"], h: Float[ndarray, "m"], tilt: Float[ndarray, "m"], respace: bool = True) -> Rail:
    """The rail moved by x to the left and h outward, its normal leaned so that `tilt` (dh/dx) becomes level."""
    points = rail.points + x[:, None] * rail.e + h[:, None] * rail.n
    lateral = rail.e + tilt[:, None] * rail.n
    t = tangents(points)
    n = unit(np.cross(t, lateral))
    return make_rail(points, n, rail.step) if respace else _with_axes(points, n, rail.step)


def lay_out(rail: Rail, points: Float[ndarray, "k 3"], origins: Float[ndarray, "k 3"] | None) -> Strip:
    """Every point in the rail's coordinates.

    Args:
        points: (k, 3) [m].  origins: (k, 3) where the camera that saw each point stood, or None.
    """
    from weldsim.seam.profile import native

    points = np.ascontiguousarray(points)
    station = _nearest(rail, points)
    k = len(points)
    s, x, h, slope, above = np.empty(k), np.empty(k), np.empty(k), np.zeros((k, 2)), np.full(k, np.inf)
    seen = np.empty((0, 3)) if origins is None else np.ascontiguousarray(origins)
    native.coordinates(points, seen, station, rail.points, rail.t, rail.e, rail.n, rail.step, s, x, h, slope, above)
    return Strip(station, s, x, h, slope, above)


def _nearest(rail: Rail, points: Float[ndarray, "k 3"]) -> Int[ndarray, "k"]:
    """Nearest station of each point.

    A rail that never turns back on its chord gives a guess at once, and a few steps along its tangents the answer; any
    other rail asks a KD-tree.
    """
    from weldsim.seam.profile import native

    chord = unit(rail.points[-1] - rail.points[0])
    place = (rail.points - rail.points[0]) @ chord
    if not (np.diff(place) > 0.3 * rail.step).all():
        return np.asarray(KDTree(rail.points).query(points)[1], dtype=np.int64)
    station = np.empty(len(points), np.int64)
    native.stations_by_chord(points, rail.points, rail.t, chord, place, rail.step, station)
    return station
