"""Where a groove is, station by station: matched against its section, then drawn smoothly."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.seam.profile.grid import Grid
from weldsim.seam.profile.rail import Rail
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.smooth import choose_strength, deviation, smooth

BLOCK = 8  # stations averaged together to judge how well the section fits
LATERAL_REACH = 3  # stations on either side that share a look at the lateral position: as far as noise is correlated
AMPLITUDE_REACHES = (3, 6, 12)  # the same for the depth
AROUND = 20  # stations on either side over which the density of the cloud is taken as even
LEAST = 0.1  # of the density of the whole seam that tells anything


@dataclass(frozen=True, eq=False)
class Track:
    """Where the groove is, station by station.

    Attributes:
        offset: (m,) lateral position of the middle of the lips relative to the rail [m].
        weight: (m,) its information, 0 where the groove was not seen.
        amplitude: (m,) apparent depth over the section's depth: 1 in the groove, 0 beside it; NaN without data.
        local: (m,) the same from the shortest look, noisier.
    misfit: rms of the grid about the section, over the rms of the grid itself, both averaged along the seam.
    """

    offset: Float[ndarray, "m"]
    weight: Float[ndarray, "m"]
    amplitude: Float[ndarray, "m"]
    local: Float[ndarray, "m"]
    misfit: float


def follow(grid: Grid, section: Section, flanked: Bool[ndarray, "m"], held: Bool[ndarray, "m"]) -> Track:
    """Lateral position and amplitude at every station, by one Gauss-Newton step each on the fitted section.

    Args:
        flanked: (m,) stations with parent surface on both sides.  held: (m,) on one side at least: there a groove
            that is already under way is still followed, past a bolt beside it, say, at a tenth of the weight.
    """
    model, slope = section.image(grid.x, grid.shear)
    # Far below the bottom or above the lips there is no groove but the table past the plate's edge, or a clamp.
    with np.errstate(invalid="ignore"):
        known = (grid.depth < deepest(section)) & (grid.depth > -0.004)
    # Inside the groove a stereo camera is about twice as noisy as on the plate.
    weight = np.where(known, 1.0, 0.0) / (1.0 + np.clip(np.abs(slope) / 0.3, 0.0, 1.0)) ** 2
    # Plates at two heights step where there is no groove too.
    plates = replace(section, depth=0.0).image(grid.x, grid.shear)[0] if section.step else 0.0
    model = model - plates
    depth = np.where(known, grid.depth - plates, 0.0)
    terms = [slope * slope, model * model, slope * (depth - model), model * depth]
    each = np.stack([(weight * term).sum(axis=1) for term in terms], axis=1)
    least = round(LATERAL_REACH * grid.sparsity)
    ss, mm, sd, _ = _window_sum(each, least).T
    enough = (mm > 0.35 * _usual(mm)) & (ss > 0)
    amplitude, local = _amplitude(each, enough, flanked, least)
    groove = enough & (np.nan_to_num(amplitude) > 0.5) & (np.nan_to_num(amplitude) < 1.7)
    seen = groove & flanked
    shift = np.where(enough, sd / np.maximum(ss, 1e-18), 0.0)
    shift = np.clip(shift, -0.3 * section.width, 0.3 * section.width)
    weights = np.where(seen, ss, 0.0) + np.where(groove & held & ~flanked & between(seen), 0.1 * ss, 0.0)
    if seen.any():
        about = np.abs(shift - np.median(shift[seen]))
        spread = 1.4826 * float(np.median(about[seen]))
        weights = np.where(about > max(6 * spread, 0.002), 0.1 * weights, weights)
    return Track(
        section.middle + shift, weights, amplitude, local, _misfit(np.where(known, depth - model, 0.0), depth, known, seen)
    )


def deepest(section: Section) -> float:
    """Depth [m] below which nothing belongs to a groove."""
    return 1.5 * section.depth + 0.002


def _amplitude(
    each: Float[ndarray, "m 4"], enough: Bool[ndarray, "m"], flanked: Bool[ndarray, "m"], least: int
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m"]]:
    """Apparent depth over the section's at each station, over the shortest window that shows it clearly, and over the
    shortest of all."""
    looks = []
    for reach in (least, *(reach for reach in AMPLITUDE_REACHES if reach > least)):
        _, mm, _, md = _window_sum(each, reach).T
        looks.append(np.where(enough, md / np.maximum(mm, 1e-18), np.nan))
        core = looks[-1][enough & flanked]
        core = core[core > 0.3]
        if len(core) < 12 or core.std() < 0.22:
            break
    return looks[-1], looks[0]


def _usual(mm: Float[ndarray, "m"]) -> Float[ndarray, "m"]:
    """What the stations around each one hold where nothing is missing: the density of a cloud falls with distance and
    with the slant at which the camera sees a bent part, so a far end holds less than the middle and is no less there.
    """
    padded = np.pad(mm, AROUND, mode="edge")
    local = np.quantile(np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1), 0.8, axis=1)
    return np.maximum(local, LEAST * np.quantile(mm, 0.8))


def between(seen: Bool[ndarray, "m"]) -> Bool[ndarray, "m"]:
    """Stations after the first and before the last one seen."""
    return (np.cumsum(seen) > 0) & (np.cumsum(seen[::-1])[::-1] > 0)


def _misfit(
    residual: Float[ndarray, "m w"], depth: Float[ndarray, "m w"], known: Bool[ndarray, "m w"], seen: Bool[ndarray, "m"]
) -> float:
    """rms of the residual over the rms of the depth, both averaged over blocks of stations where the groove was seen."""
    m = len(seen) // BLOCK
    use = (known & seen[:, None])[: m * BLOCK].reshape(m, BLOCK, -1)
    number = np.maximum(use.sum(axis=1), 1)
    sums = [((image[: m * BLOCK].reshape(m, BLOCK, -1) * use).sum(axis=1) / number) ** 2 for image in (residual, depth)]
    total = float(sums[1].sum())
    return float(np.sqrt(sums[0].sum() / total)) if total > 0 else 1.0


def _window_sum(values: Float[ndarray, "m k"], reach: int) -> Float[ndarray, "m k"]:
    """Sum over each station and its neighbours within `reach`."""
    blank = np.zeros((1, values.shape[1]))
    edge = np.zeros((reach, values.shape[1]))
    total = np.cumsum(np.concatenate([blank, edge, values, edge]), axis=0)
    return total[2 * reach + 1 :] - total[: -2 * reach - 1]


def smoothed(rail: Rail, track: Track) -> tuple[Float[ndarray, "m"], float]:
    """Lateral offset that puts the rail on the smooth curve through the stations [m], and how strongly it was smoothed.

    Beyond the stations seen, the offset stays what it was at the last one.
    """
    seen = np.nonzero(track.weight > 0)[0]
    core = slice(seen[0], seen[-1] + 1)
    target = rail.points[core] + track.offset[core, None] * rail.e[core]
    strength = choose_strength(target, track.weight[core])
    curve = smooth(target, track.weight[core], strength)
    offset = np.einsum("ij,ij->i", curve - rail.points[core], rail.e[core])
    return np.pad(offset, (seen[0], len(rail) - seen[-1] - 1), mode="edge"), strength


def track_deviation(track: Track, offset: Float[ndarray, "m"], strength: float) -> Float[ndarray, "m"]:
    """Standard deviation of the smoothed lateral position at each station [m]."""
    seen = np.nonzero(track.weight > 0)[0]
    core = slice(seen[0], seen[-1] + 1)
    weight = track.weight[core]
    sigma = deviation(np.where(weight > 0, (track.offset - offset)[core], 0.0), weight, strength)
    return np.pad(sigma, (seen[0], len(offset) - seen[-1] - 1), mode="edge")
