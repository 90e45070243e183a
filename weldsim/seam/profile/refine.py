"""One candidate groove, from a coarse line to a fitted one: rail, parent surface, cross-section, lateral track."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from weldsim.curves import resample
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.blocks import mean_blocks
from weldsim.seam.profile.grid import Grid, make_grid
from weldsim.seam.profile.lean import CERTAIN, Doubt, first_section, follow_section, settled_section
from weldsim.seam.profile.lost import Lost, no_sides, not_followed, off_surface, short, too_few
from weldsim.seam.profile.parent import LEAST_SUPPORT, Parent, fit_parent
from weldsim.seam.profile.rail import Rail, Strip, lay_out, make_rail, shift_rail
from weldsim.seam.profile.section import Section
from weldsim.seam.profile.smooth import smooth
from weldsim.seam.profile.strength import Choice
from weldsim.seam.profile.track import Track, between, follow, mean_variance, smoothed, track_deviation
from weldsim.seam.profile.views import Blocks, agree

EXTEND = 0.015  # [m] how far beyond its known part the groove is looked for, each time
LOOK_AHEAD = 0.036  # [m] how far it is looked for once at rest: noise may have hidden a stretch of it, and a plate's edge aslant
# across the groove shows on both sides. No farther: the points around a coarse line reach 42 mm from it
AT_AN_END = 0.003  # [m] before the end of its rail a groove goes on, for all one can see
MOST_LOOKS = 3
FEWEST_STATIONS = 12  # fewer say nothing about a groove
MOST_TURNS = 6
MOST_VIEWS = 8
STEEP = 0.9  # [rad] that the two sides may differ before the rail stands upright on the parent surface
WIDEST_FOOTPRINT = 1.2  # of the camera's window on a surface seen at 35 deg, over one that faces it
SETTLED = (2e-4, 5e-4)  # [m] a rail that moves less than this is done: without noise, and where cells have as much or more
BRIDGE = 0.015  # [m] a groove goes on across this without being seen
NEAR_RAIL = 0.008  # [m] above and below a rail that lies on the parent surface; a clamp at the end of one is higher
FIRST_LOOK = 12_000  # points enough to refuse what is no groove

Stage = Literal["first", "following", "settled"]  # how far a section is looked for


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The points near a groove.

    Attributes:
        points: (n, 3) [m].  origins: (n, 3) where the camera that saw each stood, or None.
    """

    points: Float[ndarray, "n 3"]
    origins: Float[ndarray, "n 3"] | None

    def thinned(self, most: int) -> "Surroundings":
        """Every so many of them, `most` to twice as many; all where they are fewer."""
        stride = max(1, len(self.points) // most)
        return Surroundings(self.points[::stride], None if self.origins is None else self.origins[::stride])

    def along(self, rail: Rail) -> Strip:
        """Each point in a rail's coordinates."""
        return lay_out(rail, self.points, self.origins)

    @cached_property
    def views(self) -> list[Int[ndarray, "_"]]:
        """Which points each view shows; none where all are of one view, or of more than MOST_VIEWS."""
        if self.origins is None or len(self.origins) == 0 or self.origins.strides[0] == 0:
            return []
        views, left = [], np.arange(len(self.origins))
        while len(left) and len(views) < MOST_VIEWS:
            same = (self.origins[left] == self.origins[left[0]]).all(axis=1)
            views.append(left[same])
            left = left[~same]
        return [] if len(left) or len(views) == 1 else views


@dataclass(frozen=True, eq=False)
class Fit:
    """A groove measured along a rail that follows the middle of its lips.

    Attributes:
        inner: half width of the strip about the rail that is kept out of the parent fit [m].
        sigma: (m,) standard deviation of the rail across the seam [m]: of the lateral track with its correlation, of
            the section's middle, and of the parent surface's height, in quadrature.
        bridge: longest stretch without a groove that does not end it [m].
    """

    rail: Rail
    parent: Parent
    grid: Grid
    section: Section
    track: Track
    inner: float
    sigma: Float[ndarray, "m"]
    bridge: float = BRIDGE

    @property
    def depth(self) -> float:
        """Of the bottom below the opening [m]: the section's is in inverse depth, which the viewpoint's height turns back."""
        return self.section.depth / (1.0 - self.section.depth / self.grid.above)

    @property
    def core(self) -> slice:
        """The longest stretch of stations at which the groove is seen."""
        return pieces(self.track.weight > 0, self.rail.step, self.bridge)[0]


def refine(
    line: Float[ndarray, "k 3"],
    normal: Float[ndarray, "3"],
    points: Float[ndarray, "n 3"],
    origins: Float[ndarray, "n 3"] | None,
    config: ProfileConfig,
) -> Fit | Lost:
    """The groove along a coarse line, or why the data do not carry one.

    Args:
        line: (k, 3) coarse centre line [m].  normal: outward, roughly.
        points: (n, 3) [m] near the line.  origins: (n, 3) viewpoints or None.
    """
    even = _eased(line, config)
    if len(even) < FEWEST_STATIONS:
        return too_few(len(even), FEWEST_STATIONS, config)
    rail = make_rail(even, np.repeat(normal[None], len(even), 0), config.station_step, EXTEND)
    inner, outer = 0.5 * config.max_width, 0.5 * config.max_width + config.side_band
    around = Surroundings(points, origins)
    few = around.thinned(FIRST_LOOK)
    strip = few.along(rail)
    parent = fit_parent(rail, strip, inner, outer)
    # Sides are at an angle, too, that are bent and seen from a slant; that is told when the rail stands upright.
    band, level, least = (inner, outer), sided(parent, config, most=STEEP), 0.7 * config.min_length
    if (length := np.count_nonzero(level) * rail.step) < least:
        return no_sides(parent, config, band, short(length, least), STEEP)
    away = off_surface(parent, band)
    rail = shift_rail(rail, np.zeros(len(rail)), parent.a, parent.b)
    strip = few.along(rail)
    parent = fit_parent(rail, strip, inner, outer)
    level = sided(parent, config)
    if (length := np.count_nonzero(level) * rail.step) < least:
        return away or no_sides(parent, config, band, short(length, least))
    guess = _first_section(make_grid(rail, strip, parent, outer), level, attached(parent), config)
    if isinstance(guess, Lost):
        return away or guess
    section, offset, seen = guess
    rail = _advance(rail, parent, section, offset, seen)
    fit = _settled(_measure(rail, section, around, config, "first"), around, config, BRIDGE)
    return (away or fit) if isinstance(fit, Lost) else fit


def resume(
    line: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    section: Section,
    points: Float[ndarray, "n 3"],
    origins: Float[ndarray, "n 3"] | None,
    config: ProfileConfig,
    bridge: float = BRIDGE,
) -> Fit | None:
    """The groove along a line that was fitted before, with other points or together with another piece of it.

    Args:
        line, normals: (k, 3) of the fitted rail [m].  section: its cross-section.
        points, origins: as in `refine`.  bridge: longest stretch without a groove that does not end it [m].
    """
    rail = make_rail(line, normals, config.station_step, EXTEND)
    around = Surroundings(points, origins)
    fit = _settled(_measure(rail, section, around, config), around, config, bridge)
    return None if isinstance(fit, Lost) else fit


def _settled(measured: "Measurement | Lost", around: Surroundings, config: ProfileConfig, bridge: float) -> Fit | Lost:
    """The fit once the rail has come to rest, and no groove is seen farther ahead."""
    for _ in range(MOST_LOOKS):
        before = _at_rest(measured, around, config, bridge)
        if isinstance(before, Lost):
            return before
        measured = _farther(before, around, config, bridge)
        if isinstance(measured, Lost):
            return _concluded(before, bridge)
        if measured.reach(bridge) <= before.reach(bridge) + FEWEST_STATIONS:
            break
    last = measured
    for _ in range(MOST_LOOKS - 1):
        if isinstance(last, Lost) or not last.goes_on(bridge, 0.3 * LOOK_AHEAD):
            break
        measured = _farther(last, around, config, bridge)
        if isinstance(measured, Lost):
            break
        last = measured
    return last if isinstance(last, Lost) else _concluded(last, bridge)


def _farther(measured: "Measurement", around: Surroundings, config: ProfileConfig, bridge: float) -> "Measurement | Lost":
    """The last, most careful measurement, along a rail that looks ahead at both ends; or why hardly any groove is seen."""
    return _measure(_next_rail(measured, bridge, LOOK_AHEAD), measured.section, around, config, "settled")


def _at_rest(measured: "Measurement | Lost", around: Surroundings, config: ProfileConfig, bridge: float) -> "Measurement | Lost":
    """The measurement after as many turns as the rail needs to come to rest and to stop growing; or why it is lost."""
    for _ in range(MOST_TURNS - 1):
        if isinstance(measured, Lost):
            return measured
        before = measured
        extend = LOOK_AHEAD if before.goes_on(bridge) else EXTEND
        measured = _measure(_next_rail(before, bridge, extend), before.section, around, config)
        if isinstance(measured, Measurement) and measured.settled and measured.reach(bridge) <= before.reach(bridge) + 2:
            break
    return measured


def _next_rail(measured: "Measurement", bridge: float, extend: float = EXTEND) -> Rail:
    """Where the groove was measured, lengthened at both ends by `extend` [m]."""
    seen = measured.track.weight > 0
    return _advance(measured.rail, measured.parent, measured.section, measured.offset, seen, bridge, extend)


@dataclass(frozen=True, eq=False)
class Measurement:
    """One turn of the fit: what was measured along a rail, and where it says the groove is.

    Attributes:
        offset: (m,) lateral position of the smoothed groove relative to the rail [m].  choice: how it was smoothed.
        doubt: how far off the section's middle may be.
    """

    rail: Rail
    parent: Parent
    grid: Grid
    section: Section
    track: Track
    inner: float
    offset: Float[ndarray, "m"]
    choice: Choice
    doubt: Doubt

    @property
    def moved(self) -> float:
        """How far the groove lies from the rail at most [m]."""
        return float(np.abs(self.offset[self.track.weight > 0]).max())

    @property
    def settled(self) -> bool:
        """Whether it moves by no more than noise may move it: what is left, one step along the section mends."""
        return self.moved < min(max(self.parent.noise, SETTLED[0]), SETTLED[1])

    def reach(self, bridge: float) -> int:
        """Stations in the longest piece seen, gaps up to `bridge` [m] bridged."""
        core = pieces(self.track.weight > 0, self.rail.step, bridge)[0]
        return core.stop - core.start

    def goes_on(self, bridge: float, margin: float = AT_AN_END) -> bool:
        """Whether the longest piece seen ends no more than `margin` [m] before an end of the rail."""
        core = pieces(self.track.weight > 0, self.rail.step, bridge)[0]
        return min(core.start, len(self.rail) - core.stop) * self.rail.step <= margin


def _measure(
    rail: Rail, start: Section, around: Surroundings, config: ProfileConfig, stage: Stage = "following"
) -> Measurement | Lost:
    """Parent surface, section and track along a rail, or why hardly any groove is seen."""
    strip = around.along(rail)
    blur = start.blur * WIDEST_FOOTPRINT
    inner = 0.5 * start.width + 0.7 * blur + 0.001
    parent = fit_parent(rail, strip, inner, inner + config.side_band, NEAR_RAIL)
    grid = make_grid(rail, strip, parent, 0.5 * start.width + blur + 0.006, around.views)
    start = replace(start, step=parent.hilo)
    flanked = sided(parent, config)
    blocks = mean_blocks(grid, flanked, start)
    if blocks is None or not agree(blocks, start.depth):
        # A camera's noise outweighs where its points lie in the cells; only without it do cells' places tell walls from blur.
        grid, blocks = grid.centred(), blocks and blocks.centred()
    section, doubt = (start, CERTAIN) if blocks is None else _fit_section(blocks, start, parent.noise, stage)
    track = follow(grid, section, flanked, attached(parent), generalised=stage == "settled")
    section = replace(section, middle=0.0)
    if np.count_nonzero(track.weight) < FEWEST_STATIONS:
        if (level := np.count_nonzero(flanked)) < FEWEST_STATIONS:
            share = f"{level} of its cross-sections, under {FEWEST_STATIONS}"
            return no_sides(parent, config, (inner, inner + config.side_band), share)
        return not_followed(track, flanked, section.depth, FEWEST_STATIONS)
    offset, choice = smoothed(rail, track)
    return Measurement(rail, parent, grid, section, track, inner, offset, choice, doubt)


def _concluded(last: Measurement, bridge: float) -> Fit:
    """The fit: the rail moved onto the smoothed groove, with its standard deviation."""
    lateral = track_deviation(last.track, last.choice)
    # Section and stations come of the same cells: noise that is in both counts once.
    doubt = last.doubt.beyond(mean_variance(last.track, last.choice))
    sigma = np.sqrt(lateral**2 + last.parent.sigma**2 + doubt**2)
    height = _opening_height(last.parent, last.section, last.offset)
    rail = shift_rail(last.rail, last.offset, height, _slope(last.parent, last.offset), respace=False)
    track = replace(last.track, offset=last.track.offset - last.offset)
    return Fit(rail, last.parent, last.grid, last.section, track, last.inner, sigma, bridge)


def sided(parent: Parent, config: ProfileConfig, most: float | None = None) -> Bool[ndarray, "m"]:
    """Stations with parent surface on both sides, at one level and of one slope, within `most` [rad] if given."""
    level = (parent.step < config.max_side_step) & (parent.angle < (most or config.max_side_angle))
    return level & (parent.support.min(axis=1) > LEAST_SUPPORT)


def attached(parent: Parent) -> Bool[ndarray, "m"]:
    """Stations with parent surface on one side at least."""
    return parent.support.max(axis=1) > 0.5


def _eased(line: Float[ndarray, "k 3"], config: ProfileConfig) -> Float[ndarray, "m 3"]:
    """The coarse line without its cell steps, its ends, which wander into corners, cut by 4 mm."""
    even = resample(line, config.station_step)
    cut = min(round(0.004 / config.station_step), (len(even) - 12) // 4)
    if cut > 0:
        even = even[cut:-cut]
    return smooth(even, np.ones(len(even)), 1e5)


def _opening_height(parent: Parent, section: Section, offset: Float[ndarray, "m"]) -> Float[ndarray, "m"]:
    """Height above the rail of the middle of the chord between the lips [m]."""
    return parent.a + parent.b * offset + parent.c * (offset**2 + (section.width / 2) ** 2)


def _slope(parent: Parent, offset: Float[ndarray, "m"]) -> Float[ndarray, "m"]:
    """Slope of the parent surface across the seam at the opening."""
    return parent.b + 2 * parent.c * offset


def _advance(
    rail: Rail,
    parent: Parent,
    section: Section,
    offset: Float[ndarray, "m"],
    seen: Bool[ndarray, "m"],
    bridge: float = BRIDGE,
    extend: float = EXTEND,
) -> Rail:
    """The next rail: moved onto the opening where the groove was seen, and lengthened again at both ends by `extend` [m]."""
    core = pieces(seen, rail.step, bridge)[0]
    moved = shift_rail(rail, offset, _opening_height(parent, section, offset), _slope(parent, offset), respace=False)
    return make_rail(moved.points[core], moved.n[core], rail.step, extend)


def pieces(seen: Bool[ndarray, "m"], step: float, bridge: float = BRIDGE) -> list[slice]:
    """Stretches of `seen` stations, longest first; gaps up to `bridge` [m] are bridged, specks dropped."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], seen.astype(np.int8), [0]])))
    runs = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    runs = [run for run in runs if run[1] - run[0] >= 5] or runs
    joined: list[tuple[int, int]] = []
    for run in runs:
        if joined and (run[0] - joined[-1][1]) * step <= bridge:
            joined[-1] = (joined[-1][0], run[1])
        else:
            joined.append(run)
    return [slice(a, b) for a, b in sorted(joined, key=lambda run: run[0] - run[1])]


def _first_section(
    grid: Grid, flanked: Bool[ndarray, "m"], held: Bool[ndarray, "m"], config: ProfileConfig
) -> tuple[Section, Float[ndarray, "m"], Bool[ndarray, "m"]] | Lost:
    """A first guess: each station's centroid, smoothed, and the mean profile's width and depth; or why there is none."""
    filled = np.maximum(grid.filled(), 0.0)
    smoothed = _evened(filled)
    middle = np.abs(grid.x) < 0.016
    if (level := np.count_nonzero(flanked)) < FEWEST_STATIONS:
        return too_few(int(level), FEWEST_STATIONS, config)
    depth = float(np.median(smoothed[flanked], axis=0)[middle].max(initial=0.0))
    if depth <= 0:
        return Lost("nothing in it lies below the surface beside it")
    filled = np.minimum(filled, 2.5 * depth)
    smoothed = np.minimum(smoothed, 2.5 * depth)
    window = smoothed * middle * (smoothed > 0.35 * depth)
    mass = window.sum(axis=1)
    groove = mass > 0.3 * np.median(mass[flanked])
    seen = groove & (flanked | (held & between(groove & flanked)))
    if (shown := np.count_nonzero(seen)) < FEWEST_STATIONS:
        return Lost(f"a depth like that of the rest at {shown} of its cross-sections, under {FEWEST_STATIONS}")
    centroid = np.where(seen, (window @ grid.x) / np.maximum(mass, 1e-12), 0.0)
    offset = smooth(centroid[:, None], seen.astype(float), 1e4)[:, 0]
    shifted = np.stack([np.interp(grid.x, grid.x - o, row) for o, row in zip(offset[seen], filled[seen], strict=True)])
    mean = np.median(_evened(shifted), axis=0)
    depth = max(float(mean[middle].max()), 1e-4)
    width = float(np.count_nonzero(mean[middle] > 0.5 * depth) * (grid.x[1] - grid.x[0]))
    section = Section(middle=0.0, width=1.4 * width, depth=1.15 * depth, floor=0.1, lean=0.0, blur=0.003)
    return section, offset, seen


def _evened(image: Float[ndarray, "m w"]) -> Float[ndarray, "m w"]:
    """The mean over each station and the four on either side; beyond the ends there is nothing."""
    return cv2.boxFilter(image, -1, (1, 9), borderType=cv2.BORDER_CONSTANT)


def _fit_section(blocks: Blocks, start: Section, noise: float, stage: Stage) -> tuple[Section, Doubt]:
    """The section fitted to blocks of stations, and how far off its middle may be.

    Args:
        noise: the least standard deviation of a cell [m]: that of the plate.
    """
    if stage == "settled":
        return settled_section(blocks, start, noise)
    return (first_section if stage == "first" else follow_section)(blocks, start, noise), CERTAIN
