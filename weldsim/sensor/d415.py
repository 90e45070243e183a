"""Depth as a D415 reports it, from exact depth: a parametric model of an active-stereo camera.

One view, no second rendering and no matching. The steps follow the way the error arises: the window
of the matcher averages disparity and so rounds grooves off; laser speckle adds noise that is alike over a few pixels and
stronger where the window sees relief; sub-pixel interpolation pulls towards whole pixels; disparity and depth are
stored in steps. Constants are fitted to a simulated stereo pair with matching (`weldsim.sensor.active_stereo`), not to a
real D415; where a figure is the maker's or a test's, its docstring says so.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray
from scipy.special import ndtri

from weldsim.errors import ConfigError, RecordError
from weldsim.quantity import Metre, Pixel, require_within
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Finish
from weldsim.sensor.disparity import correlated_field, hidden_from_right, jitter_edges, near_edges, patches, support_average

DROPOUT = {Finish.MATTE: 0.0, Finish.MILL_SCALE: 0.01, Finish.GROUND: 0.08, Finish.BLACK: 0.5}
"""Share of a surface without return. Matte is that of matching rendered pairs; ground steel there loses 0 to 16 % with the
tilt, mostly where the projector's highlight falls; the others are guesses in order. Owners report glossy black parts as
invisible and bare metal as full of holes (librealsense issues 8225, 10229, 13230)."""

COARSENESS = {Finish.MATTE: 1.0, Finish.MILL_SCALE: 1.2, Finish.GROUND: 1.5, Finish.BLACK: 2.0}
"""Factor on the noise, a guess in order but for matte."""

D415_1280X720 = CameraIntrinsics(width=1280, height=720, fx=925.0, fy=925.0, cx=640.0, cy=360.0)
"""The depth imager's widest mode, nominal (640 x 480 as calibrated is `weldsim.mounts.D415_640X480`)."""

_COARSENESS = np.array([COARSENESS[finish] for finish in Finish], np.float32)
_HOLES_BELOW = ndtri(np.array([DROPOUT[finish] for finish in Finish])).astype(np.float32)  # -inf for no holes

HOLE_SIZE = 12.0  # [px] correlation length of the holes on shiny or black surfaces
FOCAL_SPREAD, BASELINE_SPREAD = 0.015, 0.3e-3  # [1], [m] between units of a make, either way; both known to the camera
FARTHEST = 3.0  # [px] below this disparity (11 m at 640 x 480) the camera reports nothing

RANGES = {
    "focal_scale": (0.2, 5.0),
    "baseline": (1e-3, 1.0),
    "disparity_sigma": (0.0, 10.0),
    "correlation": (0.1, 50.0),
    "window": (1, 101),
    "relief_gain": (0.0, 100.0),
    "relief_limit": (1e-3, 100.0),
    "pixel_locking": (-1.0, 1.0),
    "disparity_step": (0.0, 16.0),
    "depth_unit": (0.0, 0.1),
    "max_disparity": (4.0, 1000.0),
    "temporal_fraction": (0.0, 1.0),
    "offset_sigma": (0.0, 0.5),
    "offset_limit": (0.0, 0.5),
    "edge_step": (0.01, 1000.0),
    "edge_jitter": (0.0, 50.0),
    "edge_dropout": (0.0, 1.0),
}


@dataclass(frozen=True, kw_only=True)
class D415Config:
    """The parametric D415. Defaults: 640 x 480, factory settings. What surfaces look like is the scene's to say."""

    focal_scale: float = 1.0
    """Focal length of this unit over that of the nominal intrinsics; the camera knows and reports its own."""
    baseline: Metre = 0.055
    """Distance between the two imagers (nominal; the maker's sample has 54.8 mm)."""
    disparity_sigma: Pixel = 0.075
    """Standard deviation of disparity on a matte plane. The maker: between 0.032 and 'about 0.08' (librealsense issue
    3904), depth noise z^2 sigma / (f B)."""
    correlation: Pixel = 5.3
    """Distance at which the correlation of the noise falls to 1/e; 5.0 to 5.8 px in matched rendered pairs."""
    window: int = 11
    """Side of the matcher's support window [px]; decides how far a groove is rounded off. 11 here does what matching with
    windows of 9 does to a V; that of the real camera is not published (its census window is 9)."""
    relief_gain: float = 1.0
    """Noise grows to (1 + gain) times where disparity varies by `relief_limit` or more inside the window: twice that of
    the plate inside a 6 mm V in matched rendered pairs."""
    relief_limit: Pixel = 0.8
    """Variation of disparity inside the window at which the growth of noise saturates."""
    pixel_locking: Pixel = 0.02
    """Amplitude A of the pull towards whole disparities, -A sin(2 pi d); matchers lie in 0 to 0.12, and the maker's own
    remedy is off in the factory preset."""
    disparity_step: Pixel = 1 / 32
    """Disparity is stored in these steps (the maker's white paper on sub-pixel linearity); 0 = exact."""
    depth_unit: Metre = 0.001
    """Depth is stored in these steps (the driver's default; 0.1 mm can be had); 0 = exact."""
    max_disparity: Pixel = 126.0
    """Search limit of the silicon: nothing nearer than f * baseline / max_disparity is seen."""
    temporal_fraction: float = 0.3
    """Share of the noise's standard deviation that changes with each exposure; the rest stays with the view. No published
    figure: a guess between 0.1 (matched rendered pairs) and 0.7."""
    offset_sigma: Metre = 0.0
    """Standard deviation of an error of the whole view (calibration, pose); the thesis's ten distances (table 6.2) have
    3.5 mm rms without any trend over distance."""
    offset_limit: float = 0.02
    """That error is cut off at this share of the distance (the maker's accuracy figure)."""
    edge_step: Pixel = 4.0
    """A step of disparity this large separates two surfaces; smaller ones are smeared (a step of 2 px is, in matched
    rendered pairs)."""
    edge_jitter: Pixel = 1.0
    """Standard deviation of where such an edge appears; 1 to 2 px in matched rendered pairs."""
    edge_dropout: float = 0.3
    """Share of the pixels beside such an edge that give no return, apart from those hidden from one imager."""

    @classmethod
    def randomised(cls, seed: int, base: "D415Config | None" = None) -> "D415Config":
        """The config of one unit out of many: `base` (the defaults) with the figures that differ between units, or that
        nobody has measured, drawn from their ranges.

        Focal length +-1.5 %, baseline +-0.3 mm, window 9, 11 or 13, disparity_sigma 0.05 to 0.10 px, pixel_locking 0 to
        0.12 px, temporal_fraction 0.1 to 0.7, all uniform. A function of the seed alone.
        """
        rng, base = np.random.default_rng([0xD415, seed]), base or cls()
        return replace(
            base,
            focal_scale=float(rng.uniform(1 - FOCAL_SPREAD, 1 + FOCAL_SPREAD)),
            baseline=base.baseline + float(rng.uniform(-BASELINE_SPREAD, BASELINE_SPREAD)),
            window=int(rng.choice((9, 11, 13))),
            disparity_sigma=float(rng.uniform(0.05, 0.10)),
            pixel_locking=float(rng.uniform(0.0, 0.12)),
            temporal_fraction=float(rng.uniform(0.1, 0.7)),
        )

    def __post_init__(self) -> None:
        if self.window % 2 == 0:  # it would shift the image by half a pixel
            raise ConfigError(f"sensor.window: {self.window} must be odd", key="window", value=self.window)
        require_within(self, RANGES, "sensor")


def d415(
    exact: Float32[ndarray, "h w"],
    intrinsics: CameraIntrinsics,
    config: D415Config,
    *,
    seed: Sequence[int],
    exposure: int = 0,
    finishes: UInt8[ndarray, "h w"] | None = None,
) -> Float32[ndarray, "h w"]:
    """Depth as the camera reports it [m], float32, NaN for no return.

    Args:
        exact: z-depth at pixel centres [m], NaN for nothing.
        intrinsics: of the depth image; the right imager is taken to have the same.
        seed: names the unit and the view; noise that does not change between exposures follows it.
        exposure: the rest of the noise follows this too.
        finishes: a `Finish` a pixel; None = matte everywhere.
    Raises:
        RecordError: `exact` is not of the size of the intrinsics.
    """
    shape = (intrinsics.height, intrinsics.width)
    if exact.shape != shape:
        raise RecordError(f"exact depth: shape {exact.shape}, intrinsics say {shape}", field="exact")
    c, scale = config, np.float32(intrinsics.fx * config.baseline)
    still, fresh = np.random.default_rng([*seed, 0]), np.random.default_rng([*seed, 1, exposure])
    offset = view_offset(still, c.offset_sigma)

    true = np.nan_to_num(scale / exact, nan=0.0, posinf=0.0)
    edges = near_edges(true, c.edge_step, 1 + round(c.edge_jitter))
    shown = jitter_edges(still, true, edges, c.edge_jitter)
    mean, spread = support_average(shown, c.window, c.edge_step)

    noise = _noise(spread, c, still, fresh)
    disparity = mean + (noise if finishes is None else noise * _COARSENESS[finishes])
    if c.pixel_locking:
        disparity -= np.float32(c.pixel_locking) * np.sin(np.float32(2 * np.pi) * disparity)
    if c.disparity_step:
        disparity = np.rint(disparity / np.float32(c.disparity_step)) * np.float32(c.disparity_step)

    lost = (shown <= FARTHEST) | (disparity <= FARTHEST) | (disparity > c.max_disparity) | hidden_from_right(shown, c.edge_step)
    lost.reshape(-1)[edges[patches(fresh, shape, edges) < ndtri(c.edge_dropout)]] = True
    if finishes is not None:
        lost |= correlated_field(still, shape, HOLE_SIZE) < _HOLES_BELOW[finishes]
    depth = shifted(scale / np.where(lost, np.float32(np.nan), disparity), offset, c.offset_limit)
    return in_steps(depth, c.depth_unit)


def _noise(
    spread: Float32[ndarray, "h w"], c: D415Config, still: np.random.Generator, fresh: np.random.Generator
) -> Float32[ndarray, "h w"]:
    """Disparity noise [px]: a part that stays and a part that changes, stronger over relief."""
    shape = (spread.shape[0], spread.shape[1])
    field = np.float32(np.sqrt(1 - c.temporal_fraction**2)) * correlated_field(still, shape, c.correlation)
    if c.temporal_fraction:
        field += np.float32(c.temporal_fraction) * correlated_field(fresh, shape, c.correlation)
    relief = np.minimum(spread * np.float32(c.relief_gain / c.relief_limit), np.float32(c.relief_gain))
    return np.float32(c.disparity_sigma) * field * (1 + relief)


def view_offset(rng: np.random.Generator, sigma: float) -> float:
    """The error [m] of a whole view, of standard deviation `sigma`; always takes one number from `rng`."""
    return float(rng.standard_normal()) * sigma


def shifted(depth: Float32[ndarray, "h w"], offset: float, limit: float) -> Float32[ndarray, "h w"]:
    """Depth [m] with the view's own error added, cut off at `limit` times the mean distance."""
    if not offset:
        return depth
    seen = depth[np.isfinite(depth)]
    most = limit * float(seen.mean()) if seen.size else 0.0
    return depth + np.float32(np.clip(offset, -most, most))


def in_steps(depth: Float32[ndarray, "h w"], unit: float) -> Float32[ndarray, "h w"]:
    """Depth in whole steps of `unit` [m] (0 = as it is); what is not positive becomes NaN."""
    if unit:
        depth = np.rint(depth / np.float32(unit)) * np.float32(unit)
    return np.where(depth > 0, depth, np.float32(np.nan)).astype(np.float32)


def unit_intrinsics(nominal: CameraIntrinsics, config: D415Config) -> CameraIntrinsics:
    """The intrinsics that this unit has and reports: the nominal ones with its own focal length."""
    return replace(nominal, fx=nominal.fx * config.focal_scale, fy=nominal.fy * config.focal_scale)
