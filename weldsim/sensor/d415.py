"""Depth as a D415 reports it, from exact depth: a parametric model of an active-stereo camera.

One view, no second rendering and no matching. The steps follow the way the error arises: the window of the matcher averages
disparity and so rounds grooves off; noise is alike over ten pixels and more, and stronger where the window sees relief;
sub-pixel interpolation pulls towards whole pixels; disparity is stored in steps, smoothed where the driver is told to, and
becomes depth in steps.

Noise and rims are measured on public depth frames: a D415's in the demo data of NVlabs/UnseenObjectClustering, D435s' there,
in the sample data of Shreeyak/cleargrasp and in the single scans of thillRobot/seam_detection. What a groove looks like is
fitted to a simulated stereo pair with matching (`weldsim.sensor.active_stereo`), not to a real camera. Each docstring says
which.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray
from scipy.special import ndtri

from weldsim.errors import ConfigError, RecordError
from weldsim.quantity import Metre, Pixel, require_within
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Finish
from weldsim.sensor.disparity import (
    correlated_field,
    hidden_from_right,
    jitter_edges,
    left_of,
    mixed_rims,
    near_edges,
    patches,
    support_average,
)
from weldsim.sensor.noise import NoiseField, disparity_noise

DROPOUT = {Finish.MATTE: 0.0, Finish.MILL_SCALE: 0.01, Finish.GROUND: 0.08, Finish.BLACK: 0.5}
"""Share of a surface without return. Matte is that of matching rendered pairs; ground steel there loses 0 to 16 % with the
tilt, mostly where the projector's highlight falls; the others are guesses in order. Owners report glossy black parts as
invisible and bare metal as full of holes (librealsense issues 8225, 10229, 13230)."""

COARSENESS = {Finish.MATTE: 1.0, Finish.MILL_SCALE: 1.2, Finish.GROUND: 1.5, Finish.BLACK: 2.0}
"""Factor on the noise, a guess in order but for matte."""

D415_1280X720 = CameraIntrinsics(width=1280, height=720, fx=925.0, fy=925.0, cx=640.0, cy=360.0)
"""The depth imager's widest mode, nominal (640 x 480 as calibrated is `weldsim.mounts.D415_640X480`)."""

D435_848X480 = CameraIntrinsics(width=848, height=480, fx=424.4, fy=424.4, cx=424.0, cy=240.0)
"""A D435's common mode; the focal length is that of a D435i whose pixels could be recovered (the single scans of
thillRobot/seam_detection)."""

_COARSENESS = np.array([COARSENESS[finish] for finish in Finish], np.float32)
_HOLES_BELOW = ndtri(np.array([DROPOUT[finish] for finish in Finish])).astype(np.float32)  # -inf for no holes

HOLE_SIZE = 12.0  # [px] correlation length of the holes on shiny or black surfaces
FOCAL_SPREAD, BASELINE_SPREAD = 0.015, 0.3e-3  # [1], [m] between units of a make, either way; both known to the camera
FARTHEST = 3.0  # [px] below this disparity (11 m at 640 x 480) the camera reports nothing

RANGES = {
    "focal_scale": (0.2, 5.0),
    "baseline": (1e-3, 1.0),
    "noise_gain": (0.0, 100.0),
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
    "edge_shadow": (0.0, 50.0),
    "mixed_pixels": (0.0, 1.0),
}

D415_NOISE = (
    NoiseField(sigma=0.09, along_rows=13.0, along_columns=8.6),
    NoiseField(sigma=0.045, along_rows=60.0, along_columns=40.0),
)
"""On flat parts of public frames, tilt removed: a D415's 0.095 px in all, alike over 11 to 16 px along rows and 8 to 9 along
columns, with waves of 50 to 400 mm besides; D435s' 0.07 to 0.10 px, 10 or 11 by 6 or 7 px. It is the same at 0.67 and 1.11 m."""

FILTERED_NOISE = (
    NoiseField(sigma=0.036, along_rows=8.0, along_columns=6.5),
    NoiseField(sigma=0.034, along_rows=20.0, along_columns=15.0),
    NoiseField(sigma=0.014, along_rows=60.0, along_columns=45.0),
)
"""Fitted to the spectrum of nine flat parts of one D435i at 0.93 m whose driver had smoothed its frames (the single scans of
thillRobot/seam_detection): what is left after the filter, so `spatial_filter` stays off with it."""


@dataclass(frozen=True, kw_only=True)
class D415Config:
    """The parametric D415. Defaults: 640 x 480, factory settings. What surfaces look like is the scene's to say."""

    model: ClassVar[str] = "d415"

    focal_scale: float = 1.0
    """Focal length of this unit over that of the nominal intrinsics; the camera knows and reports its own."""
    baseline: Metre = 0.055
    """Distance between the two imagers (nominal; the maker's sample has 54.8 mm)."""
    noise: tuple[NoiseField, ...] = D415_NOISE
    """Gaussian fields whose sum is the noise of disparity on a matte plane (no tilt, no relief)."""
    noise_gain: float = 1.0
    """Factor on all of them. The maker gives 0.032 to 'about 0.08' px (librealsense issue 3904), the frames 0.07 to 0.10; depth
    noise is z^2 sigma / (f B)."""
    window: int = 11
    """Side of the matcher's support window [px]; decides how far a groove is rounded off. 11 here does what matching with
    windows of 9 does to a V; that of the real camera is not published (its census window is 9)."""
    relief_gain: float = 1.0
    """Noise grows to (1 + gain) times where the window holds relief of `relief_limit` or more: twice that of the plate inside a
    6 mm V in matched rendered pairs. Tilt is no relief: on public frames noise is the same on planes of any tilt and distance."""
    relief_limit: Pixel = 0.8
    """Relief at which the growth of noise saturates: how far disparity leaves its mean over the window, highest less lowest."""
    pixel_locking: Pixel = 0.01
    """Amplitude A of the pull towards whole disparities, -A sin(2 pi d): at most 0.02 px on tilted planes of public frames."""
    disparity_step: Pixel = 1 / 32
    """Disparity is stored in these steps (the maker's white paper on sub-pixel linearity); 0 = exact."""
    spatial_filter: bool = False
    """Whether the driver smooths disparity (librealsense's spatial filter at its defaults) before it is turned into depth."""
    depth_unit: Metre = 0.001
    """Depth is stored in these steps (the driver's default; 0.1 mm can be had); 0 = exact."""
    max_disparity: Pixel = 126.0
    """Search limit of the silicon: nothing nearer than f * baseline / max_disparity is seen."""
    temporal_fraction: float = 0.42
    """Share of the noise's standard deviation that changes with each exposure; the rest stays with the view. 0.42 between two
    public D415 frames of one view, 0.7 to 0.8 between D435 frames."""
    offset_sigma: Metre = 0.0
    """Standard deviation of an error of the whole view (calibration, pose); the thesis's ten distances (table 6.2) have
    3.5 mm rms without any trend over distance."""
    offset_limit: float = 0.02
    """That error is cut off at this share of the distance (the maker's accuracy figure)."""
    edge_step: Pixel = 4.0
    """A step of disparity this large separates two surfaces; smaller ones are smeared (a step of 2 px is, in matched
    rendered pairs)."""
    edge_jitter: Pixel = 0.5
    """Standard deviation of where such an edge appears, a patch of rows at a time: with the mixed pixels it then moves by about
    0.5 px from one row to the next, as in public D415 frames (1 to 2 px in matched rendered pairs)."""
    edge_dropout: float = 0.3
    """Share of the pixels beside such an edge that give no return, apart from those hidden from one imager."""
    edge_shadow: Pixel = 1.3
    """Width lost next to what is hidden from the right imager. With dropout a shadow is 1.5 to 1.8 px wider than the
    disparities differ; 1.1 to 2.3 px in public D415 frames."""
    mixed_pixels: float = 0.2
    """Pixels with a depth between both surfaces, for each row of such an edge: 0.15 to 0.24 in public D415 frames."""

    @classmethod
    def randomised(cls, seed: int, base: "D415Config | None" = None) -> "D415Config":
        """The config of one unit out of many: `base` (the defaults) with the figures that differ between units, or that
        nobody has measured, drawn from their ranges.

        Uniform: focal length +-1.5 %, baseline +-0.3 mm, window 9, 11 or 13; noise 0.06 to 0.10 px over 8 to 16 px and 0.03 to
        0.10 px over 40 to 150 px along rows, 1.3 to 1.7 times shorter along columns; temporal_fraction 0.4 to 0.75,
        pixel_locking 0 to 0.02 px, edge_shadow 0.7 to 1.9 px, mixed_pixels 0.15 to 0.5; spatial_filter in half of the units.
        A function of the seed alone.
        """
        rng, base = np.random.default_rng([0xD415, seed]), base or cls()
        return replace(
            base,
            focal_scale=float(rng.uniform(1 - FOCAL_SPREAD, 1 + FOCAL_SPREAD)),
            baseline=base.baseline + float(rng.uniform(-BASELINE_SPREAD, BASELINE_SPREAD)),
            window=int(rng.choice((9, 11, 13))),
            noise=(_random_field(rng, (0.06, 0.10), (8.0, 16.0)), _random_field(rng, (0.03, 0.10), (40.0, 150.0))),
            temporal_fraction=float(rng.uniform(0.4, 0.75)),
            pixel_locking=float(rng.uniform(0.0, 0.02)),
            edge_shadow=float(rng.uniform(0.7, 1.9)),
            mixed_pixels=float(rng.uniform(0.15, 0.5)),
            spatial_filter=bool(rng.random() < 0.5),
        )

    def __post_init__(self) -> None:
        if self.window % 2 == 0:  # it would shift the image by half a pixel
            raise ConfigError(f"window: {self.window} must be odd", key="window", value=self.window)
        require_within(self, RANGES, "sensor" if self.model == "d415" else self.model)


@dataclass(frozen=True, kw_only=True)
class D435Config(D415Config):
    """The parametric D435: the same model and noise, imagers nearer together. Defaults: 848 x 480, factory settings."""

    model: ClassVar[str] = "d435"

    baseline: Metre = 0.050
    """Distance between the two imagers (nominal; depth steps of public frames at 640 x 480 give f B = 19255 px mm)."""


def _random_field(rng: np.random.Generator, sigma: tuple[float, float], along_rows: tuple[float, float]) -> NoiseField:
    """A field of noise with figures between those limits; blobs in public frames are 1.3 to 1.7 times as long along rows."""
    length = float(rng.uniform(*along_rows))
    return NoiseField(sigma=float(rng.uniform(*sigma)), along_rows=length, along_columns=length / float(rng.uniform(1.3, 1.7)))


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
    mean, relief = support_average(shown, c.window, c.edge_step)

    hidden = hidden_from_right(shown, c.edge_step)
    noise = _noise(relief, c, still, fresh)
    disparity = mean + (noise if finishes is None else noise * _COARSENESS[finishes])
    rims, between = mixed_rims(fresh, shown, ~hidden, c.edge_step, c.mixed_pixels)
    disparity.reshape(-1)[rims] = between
    if c.pixel_locking:
        disparity -= np.float32(c.pixel_locking) * np.sin(np.float32(2 * np.pi) * disparity)
    if c.disparity_step:
        disparity = np.rint(disparity / np.float32(c.disparity_step)) * np.float32(c.disparity_step)

    lost = hidden.copy()
    lost.reshape(-1)[edges[patches(fresh, shape, edges) < ndtri(c.edge_dropout)]] = True
    lost.reshape(-1)[left_of(fresh, hidden, c.edge_shadow)] = True
    lost.reshape(-1)[rims] = False
    lost |= (shown <= FARTHEST) | (disparity <= FARTHEST) | (disparity > c.max_disparity)
    if finishes is not None:
        lost |= correlated_field(still, shape, HOLE_SIZE) < _HOLES_BELOW[finishes]
    disparity[lost] = np.nan
    if c.spatial_filter:
        from weldsim.sensor.spatial_filter import spatially_filtered  # numba

        disparity = spatially_filtered(disparity)
    return in_steps(shifted(scale / disparity, offset, c.offset_limit), c.depth_unit)


def _noise(
    relief: Float32[ndarray, "h w"], c: D415Config, still: np.random.Generator, fresh: np.random.Generator
) -> Float32[ndarray, "h w"]:
    """Disparity noise [px]: a part that stays and a part that changes, stronger over relief."""
    field = disparity_noise(c.noise, (relief.shape[0], relief.shape[1]), c.temporal_fraction, still, fresh)
    growth = np.minimum(relief * np.float32(c.relief_gain / c.relief_limit), np.float32(c.relief_gain))
    return np.float32(c.noise_gain) * field * (1 + growth)


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
