"""Directions along a line: made to keep one side, smoothed over arc length, kept from turning too fast."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.quantity import Metre, Radian, RadianPerMetre

BATCH = 64  # nodes smoothed together
OPPOSITE = 1e-12  # length of what two opposite unit directions have in common across either, rounding apart


def one_sided(directions: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """The directions without flips: each on the side of the one before it, all on the side most of them were on."""
    same = np.einsum("ij,ij->i", directions[1:], directions[:-1]) >= 0
    sign = np.cumprod(np.concatenate([[1.0], np.where(same, 1.0, -1.0)]))
    return directions * (sign * (1.0 if sign.sum() >= 0 else -1.0))[:, None]


def smooth(s: Float[ndarray, "n"], directions: Float[ndarray, "n 3"], length: Metre) -> Float[ndarray, "n 3"]:
    """Unit directions by local linear regression over arc length `s` [m], Gaussian weights of standard deviation `length`.

    A local line, unlike a local mean, has no bias where the direction turns steadily, at the ends least of all
    (Fan and Gijbels, Local Polynomial Modelling, 1996, section 3.2.5).
    """
    if length <= 0 or len(s) < 3:
        return unit(directions)
    # Nodes count by the length they stand for, so dense stretches do not outweigh sparse ones.
    share = np.gradient(s)
    out = np.empty_like(directions)
    for first in range(0, len(s), BATCH):
        at = s[first : first + BATCH]
        low, high = np.searchsorted(s, [at[0] - 4 * length, at[-1] + 4 * length])
        d = s[low:high] - at[:, None]
        w = np.where((d >= -4 * length) & (d < 4 * length), share[low:high] * np.exp(-0.5 * (d / length) ** 2), 0.0)
        m0, m1, m2 = (moment.sum(axis=1)[:, None] for moment in (w, w * d, w * d * d))
        spread = m0 * m2 - m1 * m1
        line = spread > 1e-12 * m0 * m0 * length * length
        kernel = np.where(line, w * (m2 - m1 * d) / np.where(line, spread, 1.0), w / m0)
        out[first : first + BATCH] = kernel @ directions[low:high]
    return unit(out)


def turn(directions: Float[ndarray, "n 3"]) -> Float[ndarray, "n-1"]:
    """Angle from each direction to the next [rad]."""
    a, b = directions[:-1], directions[1:]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))


def limited(
    s: Float[ndarray, "n"], directions: Float[ndarray, "n 3"], rate: RadianPerMetre, ease: Metre = 0.0
) -> Float[ndarray, "n 3"]:
    """Unit directions that turn by at most `rate` [rad/m] of arc length; as given where none turns faster.

    A limiter run forwards lags, one run backwards leads: their middle does neither, and turns half as fast as either, so both
    may turn at twice the rate. The last pass makes good what their middle may exceed. Between opposite directions every way is as
    short: the one taken leads by the axis of the frame that they are most square to.

    Args:
        ease: length over which turns at the limit begin and end [m], the standard deviation of `smooth`. With 0 they do so at
            once: joints that follow then need an acceleration without bound, and slow the weld down.
    """
    steps = rate * np.diff(s)
    if (turn(directions) <= steps).all():
        return directions
    forwards = _chase(directions, 2 * steps)
    backwards = _chase(directions[::-1], 2 * steps[::-1])[::-1]
    middle = forwards + backwards
    for i in np.flatnonzero(np.linalg.norm(middle, axis=1) < OPPOSITE):
        middle[i] = _aside(forwards[i])
    out = _chase(unit(middle), steps)
    # A mean of directions turns no faster than they do; a local line may, at an end.
    return limited(s, smooth(s, out, ease), rate) if ease > 0 else out


def _chase(directions: Float[ndarray, "n 3"], steps: Float[ndarray, "n-1"]) -> Float[ndarray, "n 3"]:
    """Each direction turned from the one before it towards its own, by at most its step [rad]."""
    out = np.array(directions)
    for i, step in enumerate(steps):
        out[i + 1] = _towards(out[i], directions[i + 1], float(step))
    return out


def _towards(a: Float[ndarray, "3"], b: Float[ndarray, "3"], most: Radian) -> Float[ndarray, "3"]:
    """`b`, or where it is further than `most` [rad] from `a`, the direction that far from `a` on the way to it."""
    aside = b - (a @ b) * a
    length = float(np.linalg.norm(aside))
    if np.arctan2(length, a @ b) <= most or (length < OPPOSITE and a @ b > 0):
        return b
    return np.cos(most) * a + np.sin(most) * (_aside(a) if length < OPPOSITE else aside / length)


def _aside(a: Float[ndarray, "3"]) -> Float[ndarray, "3"]:
    """The unit direction square to `a`, and to its opposite, nearest to the axis that is most so."""
    axis = np.eye(3)[np.abs(a).argmin()]
    return unit(axis - (a @ axis) * a)
