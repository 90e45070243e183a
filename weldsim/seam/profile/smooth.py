"""Curves drawn smoothly through noisy stations, with the smoothing strength and the error bar taken from the data.

A penalised least-squares curve: third differences are penalised, so straight lines and arcs are not pulled inwards.
Neighbouring stations of a stereo camera share their noise, so the strength is chosen by leaving out whole blocks, and
the error bar carries the residuals' own correlation.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.linalg import solveh_banded

ORDER = 3
END_STIFFNESS = 30.0  # of the penalty at the ends, over that in the middle
END_REACH = 15.0  # stations over which it falls off
STIFFEST = 1e9  # beyond this the penalty's own rounding would outweigh FLOOR
STRENGTHS = tuple(10.0 ** np.arange(2.0, 8.6, 0.5))  # [stations^6] from a few stations to a parabola
FLOOR = 3e-5  # weight of a station without data, relative to the mean
BLOCK = 36  # stations left out together in cross-validation: well beyond where noise is correlated


def _penalty_bands(n: int, strength: float) -> Float[ndarray, "b n"]:
    """Upper bands of D'WD, W about `strength`, for third differences D of n stations, in solveh_banded's layout.

    W grows towards the ends, where a curve is held from one side only and would flap: there the curvature changes less.
    """
    coefficients = np.array([-1.0, 3.0, -3.0, 1.0])
    inward = np.minimum(np.arange(n - ORDER), np.arange(n - ORDER)[::-1])
    stiffness = np.minimum(strength * (1.0 + END_STIFFNESS * np.exp(-inward / END_REACH)), STIFFEST)
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
        strength: relative to the mean weight; see STRENGTHS.
    """
    n = len(values)
    if n <= ORDER + 1:
        return values.copy()
    scaled = weights / max(float(weights.mean()), 1e-300)
    # About the chord, so that the floor that keeps bridged stations well posed pulls towards a straight line.
    chord = values[0] + np.linspace(0.0, 1.0, n)[:, None] * (values[-1] - values[0])
    bands = _penalty_bands(n, strength)
    bands[-1] += scaled + FLOOR
    return chord + solveh_banded(bands, scaled[:, None] * (values - chord), check_finite=False)


def choose_strength(values: Float[ndarray, "n d"], weights: Float[ndarray, "n"]) -> float:
    """The strength that best predicts blocks of stations left out, the smoother one within one standard error."""
    n = len(values)
    blocks = np.arange(n) // BLOCK
    folds = [blocks % 4 == k for k in range(4)]
    scores = []
    for strength in STRENGTHS:
        error = np.zeros(n)
        for fold in folds:
            predicted = smooth(values, np.where(fold, 0.0, weights), strength)
            error[fold] = ((predicted - values)[fold] ** 2).sum(axis=1)
        per_block = np.bincount(blocks, weights=error * weights) / np.maximum(np.bincount(blocks, weights=weights), 1e-300)
        scores.append(per_block)
    table = np.array(scores)
    mean = table.mean(axis=1)
    best = int(mean.argmin())
    spread = (table - table[best]).std(axis=1) / np.sqrt(max(table.shape[1], 1))
    allowed = np.nonzero(mean <= mean[best] + spread)[0]
    return float(STRENGTHS[int(allowed.max())])


def deviation(residual: Float[ndarray, "n"], weights: Float[ndarray, "n"], strength: float) -> Float[ndarray, "n"]:
    """Standard deviation of a smoothed scalar at each station, from its residuals and their autocorrelation.

    The smoother is linear, x = S y, so its covariance is S C S'. C is taken as stationary after scaling by each
    station's weight: its autocovariance comes from the residuals, tapered so that it stays positive.
    """
    n = len(residual)
    used = weights > 0
    if used.sum() < 8:
        return np.full(n, float(np.abs(residual).max()) if n else 0.0)
    root = np.sqrt(np.where(used, weights, 0.0) / weights[used].mean())
    white = residual * root
    matrix = smooth(np.eye(n), weights, strength)
    reach = min(BLOCK, n - 1)
    lags = np.array([float(white[: n - k] @ white[k:]) for k in range(reach)]) / used.sum()
    taper = 1.0 - np.arange(reach) / reach
    index = np.abs(np.arange(n)[:, None] - np.arange(n)[None, :])
    missed = np.diag(used.astype(float)) - matrix * used[:, None]
    guess = lags * taper
    for _ in range(3):
        # What the smoother took away with the noise is given back: residuals of this covariance should look like ours.
        covariance = np.where(index < reach, guess[np.minimum(index, reach - 1)], 0.0)
        expected = missed @ covariance @ missed.T
        near = range(min(8, reach))
        shown = sum(float(np.trace(expected, offset=k)) for k in near) / used.sum()
        guess = guess * np.clip(float(lags[: len(near)].sum()) / max(shown, 1e-300), 1.0, 2.0)
    covariance = np.where(index < reach, guess[np.minimum(index, reach - 1)], 0.0)
    spread = matrix / np.where(root > 0, root, np.inf)[None, :]
    variance = ((spread @ covariance) * spread).sum(axis=1)
    return np.sqrt(np.maximum(variance, 0.0))
