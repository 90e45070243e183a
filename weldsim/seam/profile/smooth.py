"""Curves drawn smoothly through noisy stations, and their error bar.

A penalised least-squares curve: third differences are penalised, so straight lines and arcs are not pulled inwards. How
strongly, and how noisy the stations are, is told by `strength`.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.linalg import solveh_banded

ORDER = 3
END_STIFFNESS = 30.0  # of the penalty at the ends, over that in the middle
END_REACH = 15.0  # stations over which it falls off
STIFFEST = 1e9  # beyond this the penalty's own rounding would outweigh FLOOR
FLOOR = 3e-5  # weight of a station without data, relative to the mean


def end_stiffness(k: int, step: float = 1.0) -> Float[ndarray, "k"]:
    """Penalty on each of k third differences, taken `step` stations apart, over that in the middle.

    It grows towards the ends, where a curve is held from one side only and would flap: there the curvature changes less.
    """
    inward = np.minimum(np.arange(k), np.arange(k)[::-1]) * step
    return 1.0 + END_STIFFNESS * np.exp(-inward / END_REACH)


def _penalty_bands(n: int, strength: float) -> Float[ndarray, "b n"]:
    """Upper bands of D'WD, W about `strength`, for third differences D of n stations, in solveh_banded's layout."""
    coefficients = np.array([-1.0, 3.0, -3.0, 1.0])
    stiffness = np.minimum(strength * end_stiffness(n - ORDER), STIFFEST)
    bands = np.zeros((ORDER + 1, n))
    for lag in range(ORDER + 1):
        for i in range(ORDER + 1 - lag):
            start = i + lag
            bands[ORDER - lag, start : start + n - ORDER] += coefficients[i] * coefficients[i + lag] * stiffness
    return bands


def smooth(values: Float[ndarray, "n d"], weights: Float[ndarray, "n"], strength: float) -> Float[ndarray, "n d"]:
    """The penalised curve through `values` at evenly spaced stations; stations of weight 0 are bridged.

    Args:
        values: (n, d).  weights: (n,) inverse variances, any common scale.
        strength: relative to the mean weight [stations^6].
    """
    n = len(values)
    if n <= ORDER + 1:
        return values.copy()
    scaled = weights / max(float(weights.mean()), 1e-300)
    # About the chord, so that the floor that keeps bridged stations well posed pulls towards a straight line.
    chord = values[0] + np.linspace(0.0, 1.0, n)[:, None] * (values[-1] - values[0])
    bands = _penalty_bands(n, strength)
    bands[-1] += scaled + FLOOR
    return chord + solveh_banded(bands, scaled[:, None] * (values - chord), overwrite_ab=True, check_finite=False)


def deviation(weights: Float[ndarray, "n"], strength: float, correlation: Float[ndarray, "n"]) -> Float[ndarray, "n"]:
    """Standard deviation of a smoothed scalar at each station, over that of a station of mean weight.

    The smoother is linear, x = S y: what it leaves of the noise is S C S', C the noise's covariance. What it takes of the
    line itself is as likely as the strength says that the line bends: with A = W + strength D'D, strength times the sum of
    the noise's correlation times A^-1 D'D A^-1, which is A^-1 - A^-1 W A^-1.

    Args:
        correlation: of the noise of stations 0, 1, 2, ... apart.
    """
    n = len(weights)
    used = weights > 0
    if used.sum() < 8 or n <= ORDER + 1:
        return np.ones(n)
    scaled = weights / weights.mean()
    bands = _penalty_bands(n, strength)
    bands[-1] += scaled + FLOOR
    inverse = solveh_banded(bands, np.eye(n), overwrite_ab=True, check_finite=False)
    root = np.sqrt(scaled)
    index = np.arange(n)
    covariance = correlation[np.abs(index[:, None] - index)]
    spread = inverse * root
    noise = ((spread @ covariance) * spread).sum(axis=1)
    total = 2 * float(correlation.sum()) - float(correlation[0])
    line = np.diagonal(inverse) - (spread**2).sum(axis=1)
    return np.sqrt(np.maximum(noise + total * line, 0.0))
