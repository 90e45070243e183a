"""Where a groove is, station by station: matched against its section, then drawn smoothly."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.frames import unit
from weldsim.seam.profile.grid import Grid
from weldsim.seam.profile.parent import TOLERANCE
from weldsim.seam.profile.rail import Rail
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.smooth import ORDER, deviation, smooth
from weldsim.seam.profile.strength import Choice, choose, correlated_sum, correlation
from weldsim.seam.profile.views import correlation_across, deviation_across

BLOCK = 8  # stations averaged together to judge how well the section fits
LATERAL_REACH = 3  # stations on either side that share a look at the lateral position: as far as noise is correlated
AMPLITUDE_REACHES = (3, 6, 12)  # the same for the depth
AROUND = 20  # stations on either side over which the density of the cloud is taken as even
CAMERA_REACHES = (0.0, 0.002, 0.0035, 0.005, 0.007, 0.010, 0.016)  # [m] over which a camera's noise may be alike
TANGENT = 0.004  # [m] of a line's end that gives the direction in which it goes on
TURN = 8.0  # stations beyond the last one seen, over which a line that goes straight on gains its own deviation again
ENOUGH = 0.35  # of the usual data for a station
LONGEST_DIP = 0.045  # [m] over which a groove may be hidden by noise
LEAST_SPREAD = 0.05  # of the amplitude, over the amplitude
OTHER_SHARE = 0.1  # of the cells beside a groove: a camera's noise puts 0.07 of them off the plate at most, a junction 0.3 and more
PULLED = 6  # stations past a run-out, in which something else may pull at it
ABSENT = 3.0  # log likelihood ratio from which on a groove is not there
FEWEST_ROWS = 6  # independent looks at the groove that tell how noise is alike across it
QUIET = 5e-5  # [m] least standard deviation of a cell
MISSING = 1e6  # times its variance: a cell without data
ONE_SIDED = 0.1  # weight of a station with a plate on one side alone: what it has on the other is guessed
LEAST = 0.1  # of the density of the whole seam that tells anything


@dataclass(frozen=True, eq=False)
class Track:
    """Where the groove is, station by station.

    Attributes:
        offset: (m,) lateral position of the middle of the lips relative to the rail [m].
        weight: (m,) its information, 0 where the groove was not seen.
        amplitude: (m,) apparent depth over the section's depth: 1 in the groove, 0 beside it; NaN without data.
        local: (m,) the same from the shortest look, noisier.
        reach: stations on either side that share a look at the lateral position.  depth_reach: at the amplitude.
        misfit: rms of the grid about the section, over the rms of the grid itself, both averaged along the seam.
        usual: amplitude where the groove is seen.  spread: its standard deviation over `usual`.  alike: stations over which
            that is alike; all as the noise makes them.
        run_out: (m,) information of stations past the first and last one seen, where the groove goes on with a plate on one
            side alone, as past an edge aslant across it. They say where the line is, not how far a groove is sure.
    """

    offset: Float[ndarray, "m"]
    weight: Float[ndarray, "m"]
    amplitude: Float[ndarray, "m"]
    local: Float[ndarray, "m"]
    reach: int
    depth_reach: int
    misfit: float
    usual: float = 1.0
    spread: float = 0.0
    alike: float = 1.0
    run_out: Float[ndarray, "m"] | float = 0.0

    @property
    def information(self) -> Float[ndarray, "m"]:
        """(m,) of all stations that say where the line is: those seen, and those past them."""
        return self.weight + self.run_out

    @property
    def core(self) -> slice:
        """From the first to the last station that says where the line is."""
        told = np.flatnonzero(self.information > 0)
        return slice(int(told[0]), int(told[-1]) + 1)

    def absence(self, part: slice) -> float:
        """Log likelihood ratio of "no groove" to "a groove as everywhere" over a stretch of stations; those without data
        say nothing."""
        return _absence(self.amplitude[part], self.usual, self.spread, self.alike)


def follow(grid: Grid, section: Section, flanked: Bool[ndarray, "m"], held: Bool[ndarray, "m"], generalised: bool = True) -> Track:
    """Lateral position and amplitude at every station, by one Gauss-Newton step each on the fitted section.

    Args:
        generalised: whether the noise's covariance across the groove is heeded in the lateral position: worth its time at last,
            not while the rail is still on its way.
        flanked: (m,) stations with parent surface on both sides.  held: (m,) on one side at least: there a groove
            that is already under way is still followed, past a bolt beside it, say, at a tenth of the weight.
    """
    model, slope = section.image(grid.x, grid.shear)
    model -= slope * (grid.at - grid.x)  # depth falls to the left by as much as it grows when the section moves there
    # Far below the bottom or above the lips there is no groove but the table past the plate's edge, or a clamp.
    with np.errstate(invalid="ignore"):
        within = (grid.depth < deepest(section)) & (grid.depth > -0.004)
    known = within if flanked.all() else within & (flanked[:, None] | ~_beside_other(grid, section, model))
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
    enough = (mm > ENOUGH * _usual(mm)) & (ss > 0)
    amplitude, local, depth_reach = _amplitude(each, enough, flanked, least)
    groove = enough & (np.nan_to_num(amplitude) > 0.5) & (np.nan_to_num(amplitude) < 1.7)
    seen = groove & flanked
    usual, spread, alike = _waver(amplitude[seen])
    seen |= _dips(amplitude, seen, enough & flanked, grid.step, (usual, spread, alike))
    groove |= seen
    shift = np.where(enough, sd / np.maximum(ss, 1e-18), 0.0)
    if generalised and np.count_nonzero(seen) >= FEWEST_ROWS * (2 * least + 1):
        shift, ss = _correlated_shift(grid, depth - model, slope, known, seen, shift, least)
    shift = np.clip(shift, -0.3 * section.width, 0.3 * section.width)
    weights = np.where(seen, ss, 0.0) + np.where(groove & held & ~flanked & between(seen), ONE_SIDED * ss, 0.0)
    if seen.any():
        about = np.abs(shift - np.median(shift[seen]))
        spread = 1.4826 * float(np.median(about[seen]))
        weights = np.where(about > max(6 * spread, 0.002), 0.1 * weights, weights)
    other = _meets_other(within, grid.depth - plates, model, section)
    run_out = np.where(_run_out(seen, groove & ~flanked & ~other, other), ONE_SIDED * ss, 0.0)
    misfit = _misfit(np.where(known, depth - model, 0.0), depth, known, seen)
    return Track(section.middle + shift, weights, amplitude, local, least, depth_reach, misfit, usual, spread, alike, run_out)


def _flat(section: Section, model: Float[ndarray, "m w"]) -> Bool[ndarray, "m w"]:
    """Cells beside the groove, where its own section is flat."""
    return np.abs(model) < 0.02 * section.depth


def _meets_other(
    within: Bool[ndarray, "m w"], depth: Float[ndarray, "m w"], model: Float[ndarray, "m w"], section: Section
) -> Bool[ndarray, "m"]:
    """Stations beside which the surface is not the plate's, OTHER_SHARE of it and more: another groove's, say, or a clamp's.

    Args:
        within: cells with a depth that a groove may have.  depth, model: seen and expected there [m].
    """
    beside = within & _flat(section, model)
    other = beside & (np.abs(np.where(within, depth, 0.0)) > TOLERANCE)
    return np.asarray(other.sum(axis=1) > OTHER_SHARE * beside.sum(axis=1))


def _run_out(seen: Bool[ndarray, "m"], goes_on: Bool[ndarray, "m"], other: Bool[ndarray, "m"]) -> Bool[ndarray, "m"]:
    """Stations past the first and the last one seen, for as long as the groove goes on; none where it goes on up to
    something else, as another groove that it runs into, which pulls at it well before it is met."""
    out = np.zeros(len(seen), bool)
    told = np.flatnonzero(seen)
    if not len(told):
        return out
    for way, end in ((-1, int(told[0])), (1, int(told[-1]))):
        j = end + way
        while 0 <= j < len(seen) and goes_on[j]:
            j += way
        beyond = other[j : j + PULLED] if way > 0 else other[max(j + 1 - PULLED, 0) : max(j + 1, 0)]
        if not beyond.any():
            out[min(end, j) + 1 : max(end, j)] = True
    return out


def _correlated_shift(
    grid: Grid,
    residual: Float[ndarray, "m w"],
    slope: Float[ndarray, "m w"],
    known: Bool[ndarray, "m w"],
    seen: Bool[ndarray, "m"],
    shift: Float[ndarray, "m"],
    reach: int,
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m"]]:
    """Lateral shift of each station [m] and its information [1/m^2], by generalised least squares.

    A camera's error is alike across a groove: what the plate beside it shows tells much of what lies under it.

    Args:
        residual: depth less the section's [m].  slope: how the section changes as it moves to the left.
        seen: stations with a groove.  shift: a first estimate [m].  reach: stations on either side that share a look.
    """
    half = residual.shape[1] // 2

    def pooled(image: Float[ndarray, "m w"]) -> Float[ndarray, "m h"]:
        pairs = np.where(known, image, 0.0)[:, : 2 * half].reshape(len(image), half, 2).sum(axis=2)
        return _window_sum(pairs, reach)

    number = pooled(np.ones_like(residual))
    some = np.maximum(number, 1.0)
    mean, lead = pooled(residual) / some, pooled(slope) / some
    held = number > 0
    rows = np.flatnonzero(seen)[:: 2 * reach + 1]
    off = np.where(held, mean - shift[:, None] * lead, 0.0)[rows]
    x = grid.x[: 2 * half].reshape(half, 2).mean(axis=1)
    sd = deviation_across(np.where(held[rows], np.abs(off), np.nan), QUIET)
    usual = np.maximum(np.median(number[rows], axis=0), 1.0)
    tame = 1 / np.maximum(np.abs(off) / (2.5 * sd), 1.0)
    covariance = correlation_across(off * tame / sd, held[rows], x) * np.outer(sd, sd)
    loose = np.where(held, np.clip(usual / some - 1, 0.0, None), MISSING) * sd**2
    systems = covariance + loose[:, :, None] * np.eye(half)
    pull = np.linalg.solve(systems, lead[..., None])[..., 0]
    information = np.maximum((pull * lead).sum(axis=1), 1e-18)
    return (pull * mean).sum(axis=1) / information, information


def _beside_other(grid: Grid, section: Section, model: Float[ndarray, "m w"]) -> Bool[ndarray, "m w"]:
    """Cells within half the camera's window of something that is neither the groove nor the plate."""
    with np.errstate(invalid="ignore"):
        other = (grid.depth >= deepest(section)) | (grid.depth <= -0.004)
        other |= _flat(section, model) & (np.abs(grid.depth) > TOLERANCE)
    marked = other.astype(np.uint8)
    # A stray point is no surface.
    number = cv2.boxFilter(marked, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    marked[number < 3] = 0
    half = 0.5 * section.blur
    window = np.ones((2 * round(half / grid.step) + 1, 2 * round(half / (grid.x[1] - grid.x[0])) + 1), np.uint8)
    return cv2.dilate(marked, window) > 0


def deepest(section: Section) -> float:
    """Depth [m] below which nothing belongs to a groove."""
    return 1.5 * section.depth + 0.002


def _amplitude(
    each: Float[ndarray, "m 4"], enough: Bool[ndarray, "m"], flanked: Bool[ndarray, "m"], least: int
) -> tuple[Float[ndarray, "m"], Float[ndarray, "m"], int]:
    """Apparent depth over the section's at each station, over the shortest window that shows it clearly, and over the
    shortest of all; and the stations on either side of the former."""
    looks, reach = [], least
    for reach in (least, *(reach for reach in AMPLITUDE_REACHES if reach > least)):
        _, mm, _, md = _window_sum(each, reach).T
        looks.append(np.where(enough, md / np.maximum(mm, 1e-18), np.nan))
        core = looks[-1][enough & flanked]
        core = core[core > 0.3]
        if len(core) < 12 or core.std() < 0.22:
            break
    return looks[-1], looks[0], reach


def _dips(
    amplitude: Float[ndarray, "m"],
    seen: Bool[ndarray, "m"],
    known: Bool[ndarray, "m"],
    step: float,
    waver: tuple[float, float, float],
) -> Bool[ndarray, "m"]:
    """Stations between two seen ones at which the amplitude is off, but by no more than the noise makes likely.

    Args:
        known: stations with enough data: others are no dip.  waver: usual amplitude, its relative spread, and over how many
            stations that is alike.
    """
    out = np.zeros(len(seen), bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[1], seen.astype(np.int8), [1]])))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        whole = start > 0 and stop < len(seen) and (stop - start) * step <= LONGEST_DIP and known[start:stop].all()
        if whole and _absence(amplitude[start:stop], *waver) < ABSENT:
            out[start:stop] = True
    return out


def _absence(amplitude: Float[ndarray, "k"], usual: float, spread: float, alike: float) -> float:
    """As `Track.absence`."""
    known = amplitude[np.isfinite(amplitude)] / max(usual, 1e-9)
    return float((1 - 2 * np.clip(known, 0.0, 2.0)).sum()) / (2 * max(spread, LEAST_SPREAD) ** 2 * alike)


def _waver(values: Float[ndarray, "n"]) -> tuple[float, float, float]:
    """Median of the amplitudes where a groove is seen, their relative standard deviation, and over how many stations they are
    alike; no spread where they are too few to tell."""
    if len(values) < 4 * AROUND:
        return 1.0, 0.0, 1.0
    middle, high = np.quantile(values, [0.5, 0.84]).tolist()  # from above: below, what is off is not among them
    return middle, (high - middle) / middle, _alike(values - middle)


def _alike(values: Float[ndarray, "n"]) -> float:
    """Over how many stations values are alike: the sum of their correlations up to the first that is small."""
    power = max(float(values @ values) / len(values), 1e-12)
    total = 1.0
    for lag in range(1, len(values) // 4):
        correlation = float(values[lag:] @ values[:-lag]) / (len(values) - lag) / power
        if correlation < 0.1:
            break
        total += 2 * correlation
    return total


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


def smoothed(rail: Rail, track: Track) -> tuple[Float[ndarray, "m"], Choice]:
    """Lateral offset that puts the rail on the smooth curve through the stations [m], and how it was smoothed.

    It is the curve's third differences along the rail's lateral axes that shall be small, as on a line or an arc: so a
    lateral position with the rail's own is added to the offsets before they are smoothed, and taken away after. Beyond the
    stations seen, the line goes straight on.
    """
    core = track.core
    bow = _bow(rail.points[core], rail.e[core])
    values, weight = track.offset[core] + bow, track.information[core]
    shared = 2 * track.reach + 1
    lengths = np.sqrt(shared**2 / 3 + (np.array(CAMERA_REACHES) / rail.step) ** 2)
    choice = choose(values, weight, lengths, track.reach + 1)
    offset = smooth(values[:, None], weight, choice.strength)[:, 0] - bow
    return _led_on(rail, core, offset), choice


def _led_on(rail: Rail, core: slice, offset: Float[ndarray, "k"]) -> Float[ndarray, "m"]:
    """The lateral offsets of a stretch of stations, and beyond it those that lead straight on [m].

    A few millimetres at most are beyond, and the curvature with which noisy stations end is half noise.
    """
    out = np.pad(offset, (core.start, len(rail) - core.stop))
    reach = min(round(TANGENT / rail.step), len(offset) - 1)
    if reach == 0:
        return np.pad(offset, (core.start, len(rail) - core.stop), mode="edge")
    line = rail.points[core] + offset[:, None] * rail.e[core]
    for last, before, beyond in (
        (line[0], line[reach], slice(0, core.start)),
        (line[-1], line[-1 - reach], slice(core.stop, None)),
    ):
        along = unit(last - before)
        base, e = rail.points[beyond], rail.e[beyond]
        onto = base - last
        foot = last + (onto @ along)[:, None] * along
        out[beyond] = np.einsum("ij,ij->i", foot - base, e)
    return out


def _bow(points: Float[ndarray, "k 3"], e: Float[ndarray, "k 3"]) -> Float[ndarray, "k"]:
    """A function with the third differences of a rail along its lateral axes [m], but for a parabola."""
    k = len(points)
    out = np.zeros(k)
    if k <= ORDER:
        return out
    out[ORDER:] = np.einsum("ij,ij->i", np.diff(points, n=ORDER, axis=0), 0.5 * (e[1:-2] + e[2:-1]))
    for _ in range(ORDER):
        out = np.cumsum(out)
    at = np.linspace(-1.0, 1.0, k)
    return out - np.polyval(np.polyfit(at, out, ORDER - 1), at)


def track_deviation(track: Track, choice: Choice) -> Float[ndarray, "m"]:
    """Standard deviation of the smoothed lateral position at each station [m]."""
    core = track.core
    weight = track.information[core]
    sigma = deviation(weight, choice.strength, correlation(np.arange(len(weight)), choice.length)) * np.sqrt(choice.variance)
    # Beyond, the line goes straight on, and is wrong in its direction too.
    before, after = core.start - np.arange(core.start), np.arange(1, len(track.weight) - core.stop + 1)
    return np.concatenate([sigma[0] * np.hypot(1.0, before / TURN), sigma, sigma[-1] * np.hypot(1.0, after / TURN)])


def mean_variance(track: Track, choice: Choice) -> float:
    """Variance of the stations' mean lateral position [m^2], with the correlation of their noise."""
    number = np.count_nonzero(track.weight)
    return choice.variance * min(correlated_sum(choice.length) / max(number, 1), 1.0)
