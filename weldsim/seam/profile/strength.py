"""How strongly to smooth stations, and how noisy they are: both from the stations' own likelihood.

The line's third differences and the noise are taken as Gaussian, the noise with a correlation that a camera's window and
the looks shared between stations give it; strength, level and length of the noise are those under which third differences
like ours are likely (restricted maximum likelihood: whatever parabola they lie on has no say). Leaving stations out tells
less: noise alike over many stations is told from a wave of the groove by its spectrum, not by the stations next to it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Shaped
from numpy import ndarray

from weldsim.seam.profile.smooth import ORDER, end_stiffness

STRENGTHS = 10.0 ** np.arange(-2.0, 10.1, 0.5)  # [stations^6] from hardly any to a parabola
USUAL = (6.0, 3.0)  # log10 of the strength before anything is seen, and its deviation: seams are straight or bend over 0.1 m and
# more, and under the noise of a depth camera their third differences are those of strengths of 10^6 to 10^9
WHITE = 0.1  # of the noise's variance is taken as independent: a Gaussian correlation alone would be too smooth to be true
FEWEST_BLOCKS = 7  # tell nothing of a strength
UNDECIDED = 1e5  # the strength then: waves under about 45 stations are noise
MISSING = 1e6  # times the usual variance: a block that is not there


@dataclass(frozen=True)
class Choice:
    """Attributes:
    strength: [stations^6] noise per station that is left in a mean of many, over the variance of third differences.
    variance: of a station of mean weight.  length: [stations] of the noise's correlation exp(-(lag / length)^2).
    """

    strength: float
    variance: float
    length: float


def correlation(lag: Shaped[ndarray, "*k"], length: float) -> Float[ndarray, "*k"]:
    """Correlation of the noise of stations `lag` apart."""
    return (1 - WHITE) * np.exp(-((lag / length) ** 2)) + WHITE * (lag == 0)


def correlated_sum(length: float) -> float:
    """How many times as much noise a mean of many stations holds as if it were independent."""
    reach = np.ceil(4 * length)
    return float(correlation(np.arange(-reach, reach + 1), length).sum())


def choose(values: Float[ndarray, "n"], weights: Float[ndarray, "n"], lengths: Float[ndarray, "l"], block: int) -> Choice:
    """The strength with which to smooth stations and the noise they have, each averaged over all that are likely.

    Averaged, since a choice between strengths that are about as likely would make the line jump.

    Args:
        values: at evenly spaced stations.  weights: inverse variances, any common scale; 0 = no data.
        lengths: that the noise's correlation may have [stations].
        block: stations taken together: what goes on within is not looked at.
    """
    means, deviation, held = _blocks(values, weights, block)
    if np.count_nonzero(held) < FEWEST_BLOCKS:
        return _undecided(values, weights, float(lengths[len(lengths) // 2]))
    k = len(means)
    differences = np.diff(np.eye(k), n=ORDER, axis=0) * np.sqrt(end_stiffness(k - ORDER, block))[:, None]
    noise = np.stack([_block_correlation(k, length, block) for length in lengths.tolist()]) * np.outer(deviation, deviation)
    scale, axes = np.linalg.eigh(differences @ noise @ differences.T)
    power = ((differences @ means) @ axes) ** 2
    total = np.array([correlated_sum(length) for length in lengths.tolist()])
    # For each length and strength: the variance of each independent combination over that of a station.
    relative = scale[:, None, :] + (total[:, None] / STRENGTHS * float(block) ** (2 * ORDER))[..., None]
    number = power.shape[1] - np.count_nonzero(~held)
    variance = (power[:, None, :] / relative).sum(axis=2) / number
    likely = -0.5 * (number * np.log(np.maximum(variance, 1e-300)) + np.log(relative).sum(axis=2))
    likely -= 0.5 * ((np.log10(STRENGTHS) - USUAL[0]) / USUAL[1]) ** 2
    chance = np.exp(likely - likely.max())
    chance /= chance.sum()
    strength = 10.0 ** float(chance.sum(axis=0) @ np.log10(STRENGTHS))
    return Choice(strength, float((chance * variance).sum()), float(chance.sum(axis=1) @ lengths))


def _blocks(
    values: Float[ndarray, "n"], weights: Float[ndarray, "n"], block: int
) -> tuple[Float[ndarray, "k"], Float[ndarray, "k"], Bool[ndarray, "k"]]:
    """Means of blocks of stations, their standard deviation over that of a station of mean weight, and which are whole."""
    k = len(values) // block
    start = (len(values) - k * block) // 2
    part = weights[start : start + k * block].reshape(k, block)
    held = np.asarray((part > 0).all(axis=1), dtype=bool)
    means = values[start : start + k * block].reshape(k, block).mean(axis=1)
    if held.any():
        means = np.interp(np.arange(k), np.flatnonzero(held), means[held])
    usual = weights[weights > 0].mean() if (weights > 0).any() else 1.0
    variance = (usual / np.maximum(part, 1e-3 * usual)).mean(axis=1)
    return means, np.sqrt(np.where(held, variance, MISSING)), held


def _block_correlation(k: int, length: float, block: int) -> Float[ndarray, "k k"]:
    """Covariance of the means of k blocks of stations of unit variance."""
    apart = np.arange(1 - block, block)
    share = (block - np.abs(apart)) / block**2
    lags = correlation(np.arange(k)[:, None] * block + apart, length) @ share
    index = np.arange(k)
    return lags[np.abs(index[:, None] - index)]


def _undecided(values: Float[ndarray, "n"], weights: Float[ndarray, "n"], length: float) -> Choice:
    """The choice for a handful of stations: a middling strength, all that a parabola leaves is noise."""
    used = weights > 0
    if np.count_nonzero(used) <= ORDER:
        return Choice(UNDECIDED, float(np.ptp(values)) ** 2 if len(values) else 0.0, length)
    at = np.linspace(-1.0, 1.0, len(values))
    left = (values - np.polyval(np.polyfit(at[used], values[used], ORDER - 1), at))[used]
    relative = weights[used] / weights[used].mean()
    return Choice(UNDECIDED, float(relative @ left**2) / (np.count_nonzero(used) - ORDER), length)
