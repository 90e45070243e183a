"""How far waypoints scatter about a smooth curve, and a curve that follows them as closely as that scatter allows.

Waypoints of other programs are often measured, or planned from measured points. A motion through each of them to a hundredth of a
millimetre needs joint accelerations that are the scatter's alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.interpolate import BSpline, make_smoothing_spline

from weldsim.curves import arc_length, project
from weldsim.frames import Transform
from weldsim.records import TorchPath

FEWEST = 7  # waypoints of which scatter can be told
SAME = 1e-6  # [m] waypoints nearer to each other are one place
STILL = (5e-5, 0.02)  # [m], of the longer steps: nearer waypoints were recorded while the arm stood still
STEP = 0.001  # [m] between the poses of a refitted path
LEAST = (1e-6, 1e-5)  # [m], [rad] scatter that counts as none
QUANTILE = 0.35  # of the waypoints' distances: two corners among a dozen waypoints have no say yet
WEAVE = {24: 0.9, 56: 0.7, 96: 0.6}  # share of the variance at one frequency that tells a weave, by waypoints; noise 1 in 100
REPEATS = {4: 0.98, 12: 0.95, 24: 0.93}  # share of it that comes again every so many waypoints, likewise
FREQUENCIES = 96  # waypoints from which one frequency tells enough, and what comes again is not looked for
EVEN = 0.1  # of the variances of the scatter, the least over the greatest direction's: three axes of noise come to over 0.5
LENGTHS = (0.9282, 1.2816)  # that share of vectors of two and of three independent standard normal components is shorter
STRENGTHS = (1e-14, 1e2)  # of smoothing, over arc length in units of the path's own: none and almost a straight line


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Standard deviation of the waypoints about a smooth curve, each axis alone: position across travel [m], rotation [rad].

    Along travel nobody can tell: where a waypoint ought to be on its curve is not known.
    """

    position: float
    rotation: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Refit:
    """A smooth curve near the waypoints.

    Attributes:
        path: poses STEP apart.  nearest: (n,) index of the one on it for each waypoint.
        position_off, rotation_off: greatest distance [m] and angle [rad] of a waypoint from the curve.
        chord_off: greatest distance of the curve from the straight lines between the waypoints [m].
    """

    path: TorchPath
    nearest: ndarray
    position_off: float
    rotation_off: float
    chord_off: float


def scatter_of(path: TorchPath) -> Scatter:
    """The waypoints' scatter: how far each is from the cubic through the two before and the two after it.

    From the distance that QUANTILE of them keep to: corners and jumps, which are few, have no say. A weave is no scatter.
    """
    places = distinct(path)
    if len(places) < FEWEST:
        return Scatter(position=0.0, rotation=0.0)
    p, q = path.X_BT.p[places], _continuous(path.X_BT.quaternion[places])
    return Scatter(
        position=_deviation(p, p, LENGTHS[0]), rotation=_deviation(2.0 * q, p, LENGTHS[1])
    )  # half the turn is in a quaternion


def position_scatter(p: Float[ndarray, "n 3"]) -> float:
    """The scatter of positions alone [m], no two of which are in one place; of too few it is none, and a weave counts too."""
    return _deviation(p, p, LENGTHS[0], weave=True) if len(p) >= FEWEST else 0.0


def _deviation(values: Float[ndarray, "n d"], p: Float[ndarray, "n 3"], length: float, weave: bool = False) -> float:
    """Standard deviation of each axis of values at places p, whose distances from the cubic have this length at QUANTILE.

    Args:
        weave: whether a weave is scatter.
    """
    weights = _cubic_weights(arc_length(p))
    off_cubic = _off_cubic(values, weights)
    if not weave and _weaves(off_cubic):
        return 0.0
    scale = np.sqrt(1.0 + np.sum(weights**2, axis=1))
    return float(np.quantile(np.linalg.norm(off_cubic, axis=1) / scale, QUANTILE)) / length


def is_even(path: TorchPath) -> bool:
    """Whether the waypoints' places scatter alike in every direction, as noise does, and a weave, which is flat, does not."""
    p = path.X_BT.p[distinct(path)]
    if len(p) < FEWEST:
        return False
    off = _off_cubic(p, _cubic_weights(arc_length(p)))
    spread = np.linalg.eigvalsh(off.T @ off)
    return bool(spread[0] > EVEN * spread[-1])


def _weaves(off: Float[ndarray, "m d"]) -> bool:
    """Whether the distances from a smooth curve come and go at one frequency, or come again after so many waypoints, as a
    weave's do: noise has all frequencies, and never comes again."""
    if len(off) < FREQUENCIES and _repeated(off) > _at_least(REPEATS, len(off)):
        return True
    power = np.sum(np.abs(np.fft.rfft(off - off.mean(axis=0), axis=0)[1:]) ** 2, axis=1)
    if power.sum() <= 0:
        return False
    line = int(power.argmax())
    return bool(power[max(line - 1, 0) : line + 2].sum() > _at_least(WEAVE, len(off)) * power.sum())


def _at_least(limits: dict[int, float], count: int) -> float:
    """The limit for so many waypoints; for fewer than any is given for, one that nothing is above."""
    return next((limits[least] for least in sorted(limits, reverse=True) if count >= least), np.inf)


def _repeated(off: Float[ndarray, "m d"]) -> float:
    """The greatest share of the variance of rows that comes again every k rows, at least twice; 0 of rows that are all alike."""
    off = off - off.mean(axis=0)
    total, share = float((off**2).sum()), 0.0
    for k in range(2, len(off) // 2 + 1):
        rest = sum(float(((off[i::k] - off[i::k].mean(axis=0)) ** 2).sum()) for i in range(k))
        share = max(share, 1.0 - rest / total) if total > 0 else 0.0
    return share


def _off_cubic(values: Float[ndarray, "n d"], weights: Float[ndarray, "m 4"]) -> Float[ndarray, "m d"]:
    """Each value, but for two at both ends, from what the two before and the two after it make it."""
    around = np.stack([values[i : len(values) - 4 + i] for i in (0, 1, 3, 4)], axis=1)
    return values[2:-2] - np.einsum("ij,ijk->ik", weights, around)


def refit(path: TorchPath, scatter: Scatter, share: float = 1.0) -> Refit:
    """The smoothest curve whose root mean square distance from the waypoints is `share` of their scatter.

    Of positions that is the distance across the curve: waypoints that lie closer than they scatter lead forth and back along it.
    """
    places = distinct(path)
    p, q = path.X_BT.p[places], _continuous(path.X_BT.quaternion[places])
    s = arc_length(p)
    u = s / s[-1]
    position = _smoothed(u, p, share * max(scatter.position, LEAST[0]) * np.sqrt(2.0), across=True)
    rotation = _smoothed(u, q, share * max(scatter.rotation, LEAST[1]) * np.sqrt(3.0) / 2.0)
    length = float(arc_length(position(np.linspace(0.0, 1.0, len(places))))[-1])
    dense = np.linspace(0.0, 1.0, max(len(places), int(np.ceil(length / STEP)) + 1))
    R = Transform.from_quaternion("BT", _unit(rotation(dense)), position(dense))
    at_waypoints = Transform.from_quaternion("BT", _unit(rotation(u)), position(u))
    index = np.searchsorted(places, np.arange(len(path.X_BT)), side="right") - 1
    nearest = nearest_in_order(dense, u)
    before = places[np.clip(np.searchsorted(u, dense, side="right") - 1, 0, len(places) - 2)]
    turn = 2.0 * np.arccos(np.clip(np.abs(np.sum(at_waypoints.quaternion * q, axis=1)), 0.0, 1.0))
    fitted = TorchPath(
        X_BT=R,
        s=arc_length(R.p),
        speed=path.speed[before],
        arc_on=path.arc_on[before],
        segments=tuple(path.segments[i] for i in before),
        roll_free=path.roll_free,
    )
    return Refit(
        path=fitted,
        nearest=nearest[index],
        position_off=float(project(p, R.p)[0].max()),
        rotation_off=float(turn.max()),
        chord_off=float(project(R.p, p)[0].max()),
    )


def nearest_in_order(values: Float[ndarray, "n"], at: Float[ndarray, "m"]) -> Int[ndarray, "m"]:
    """Index of the one of the values, which rise, that is nearest to each of `at`; of two equally near the first."""
    after = np.clip(np.searchsorted(values, at), 1, len(values) - 1)
    return np.where(at - values[after - 1] <= values[after] - at, after - 1, after)


def distinct(path: TorchPath) -> ndarray:
    """Indices of the waypoints, without those in the same place as the one before, but for noise."""
    steps = np.linalg.norm(np.diff(path.X_BT.p, axis=0), axis=1)
    same = max(SAME, min(STILL[0], STILL[1] * float(np.quantile(steps, 0.9))))
    kept = [0]
    for i in range(1, len(path.X_BT)):
        if np.linalg.norm(path.X_BT.p[i] - path.X_BT.p[kept[-1]]) > same:
            kept.append(i)
    return np.array(kept)


def _continuous(q: Float[ndarray, "n 4"]) -> Float[ndarray, "n 4"]:
    """The quaternions, neighbours on the same side."""
    flips = np.cumprod(np.concatenate([[1.0], np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0)]))
    return q * flips[:, None]


def _unit(q: Float[ndarray, "n 4"]) -> Float[ndarray, "n 4"]:
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _cubic_weights(s: Float[ndarray, "n"]) -> Float[ndarray, "m 4"]:
    """Lagrange's weights of the two places before and the two after each, at that place."""
    around = np.stack([s[i : len(s) - 4 + i] for i in (0, 1, 3, 4)], axis=1)
    at = s[2:-2, None]
    out = np.ones((len(at), 4))
    for k in range(4):
        for j in range(4):
            if j != k:
                out[:, k] *= (at[:, 0] - around[:, j]) / (around[:, k] - around[:, j])
    return out


def _smoothed(u: Float[ndarray, "n"], values: Float[ndarray, "n d"], distance: float, *, across: bool = False) -> BSpline:
    """The spline with the strongest smoothing whose root mean square distance from the values is `distance` at most.

    Args:
        across: whether only what of the distance is across the spline counts.
    """
    best = make_smoothing_spline(u, values, lam=0.0)
    if distance <= LEAST[0]:
        return best
    low, high = np.log(STRENGTHS[0]), np.log(STRENGTHS[1])
    for _ in range(40):
        middle = (low + high) / 2
        spline = make_smoothing_spline(u, values, lam=float(np.exp(middle)))
        off = spline(u) - values
        if across:
            along = spline.derivative()(u)
            along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
            off -= np.sum(off * along, axis=1, keepdims=True) * along
        if np.sqrt(np.mean(np.sum(off**2, axis=1))) <= distance:
            best, low = spline, middle
        else:
            high = middle
    return best
