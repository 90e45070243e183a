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
END_STIFFNESS = 100.0  # of the penalty at the ends, over that in the middle
END_REACH = 15.0  # stations over which it falls off
STIFFEST = 1e9  # beyond this the penalty's own rounding would outweigh FLOOR
STRENGTHS = tuple(10.0 ** np.arange(2.0, 8.6, 0.5))  # [stations^6] from a few stations to a parabola
LENGTHS = (0.6, 2.0, 3.5, 5.0, 7.0, 10.0, 14.0)  # [stations] correlation lengths tried for the noise
PROBES = 32  # columns of noise by which the smoother is probed
FLOOR = 3e-5  # weight of a station without data, relative to the mean
BLOCK = 24  # stations left out together in cross-validation: well beyond where noise is correlated


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


def smooth(
    values: Float[ndarray, "n d"], weights: Float[ndarray, "n"], strength: float, prior: Float[ndarray, "n d"] | None = None
) -> Float[ndarray, "n d"]:
    """The penalised curve through `values` at evenly spaced stations; stations of weight 0 are bridged.

    Args:
        values: (n, d).  weights: (n,) inverse variances, any common scale.
        strength: relative to the mean weight; see STRENGTHS.
        prior: (n, d) what stations without data are held to, hardly at all; their chord unless given.
    """
    return _smooth_each(values, weights[None], strength, prior)[0]


def _smooth_each(
    values: Float[ndarray, "n d"], weights: Float[ndarray, "k n"], strength: float, prior: Float[ndarray, "n d"] | None = None
) -> Float[ndarray, "k n d"]:
    """The penalised curve for each set of weights, as one system: the last rows of a block do not reach the next one."""
    k, (n, d) = len(weights), values.shape
    if n <= ORDER + 1:
        return np.repeat(values[None], k, axis=0)
    scaled = weights / np.maximum(weights.mean(axis=1, keepdims=True), 1e-300)
    # About the chord, so that the floor that keeps bridged stations well posed pulls towards a straight line.
    chord = values[0] + np.linspace(0.0, 1.0, n)[:, None] * (values[-1] - values[0])
    bands = np.tile(_penalty_bands(n, strength), k)
    bands[-1] += scaled.ravel() + FLOOR
    right = scaled[..., None] * (values - chord)
    if prior is not None:
        right += FLOOR * (prior - chord)
    return chord + solveh_banded(bands, right.reshape(-1, d), overwrite_ab=True, check_finite=False).reshape(k, n, d)


def choose_strength(values: Float[ndarray, "n d"], weights: Float[ndarray, "n"]) -> float:
    """The strength that best predicts blocks of stations left out, the smoother one within one standard error."""
    n = len(values)
    blocks = np.arange(n) // BLOCK
    folds = np.array([blocks % 4 == k for k in range(4)])
    scores = []
    for strength in STRENGTHS:
        error = np.zeros(n)
        for fold, predicted in zip(folds, _smooth_each(values, np.where(folds, 0.0, weights), strength), strict=True):
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

    The smoother is linear, x = S y, so its covariance is S C S'. C is stationary after scaling by each station's weight,
    with a Gaussian correlation whose variance and length are those that make residuals like ours: the smoother takes part
    of the noise away with the signal, so the residuals' own autocovariance would tell too little.
    """
    n = len(residual)
    used = weights > 0
    if used.sum() < 8 or n <= ORDER + 1:
        return np.full(n, float(np.abs(residual).max()) if n else 0.0)
    root = np.sqrt(np.where(used, weights, 0.0) / weights[used].mean())
    reach = min(BLOCK, n // 2)
    seen = _autocovariance((residual * root)[:, None], reach)
    best, variance, length = np.inf, 0.0, LENGTHS[0]
    probes = np.random.default_rng(0).standard_normal((n, PROBES))
    for candidate in LENGTHS:
        noise = _correlated(probes, candidate)
        raw = noise / np.where(used, root, np.inf)[:, None]
        shown = _autocovariance((raw - smooth(raw, weights, strength)) * root[:, None], reach)
        scale = max(float(seen @ shown) / float(shown @ shown), 0.0)
        misfit = float(((seen - scale * shown) ** 2).sum())
        if misfit < best:
            best, variance, length = misfit, scale, candidate
    lag = np.arange(n)
    covariance = (variance * np.exp(-((lag / length) ** 2)))[np.abs(lag[:, None] - lag[None, :])]
    spread = smooth(np.eye(n), weights, strength) / np.where(used, root, np.inf)[None, :]
    return np.sqrt(np.maximum(((spread @ covariance) * spread).sum(axis=1), 0.0))


def _autocovariance(values: Float[ndarray, "n d"], reach: int) -> Float[ndarray, "k"]:
    """Autocovariance at lags 0 to reach - 1, averaged over the columns."""
    n = len(values)
    return np.array([float((values[: n - k] * values[k:]).sum()) / values.size for k in range(reach)])


def _correlated(white: Float[ndarray, "n d"], length: float) -> Float[ndarray, "n d"]:
    """Columns of unit variance with autocorrelation exp(-(lag / length)^2), made from white ones."""
    n = len(white)
    lag = np.minimum(np.arange(n), n - np.arange(n))
    power = np.maximum(np.fft.rfft(np.exp(-((lag / length) ** 2))).real, 0.0)
    return np.fft.irfft(np.fft.rfft(white, axis=0) * np.sqrt(power)[:, None], n, axis=0)
