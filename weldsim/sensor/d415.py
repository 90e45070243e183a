"""Depth as a D415 reports it, from exact depth: a parametric model of an active-stereo camera.

One view, no second rendering and no matching. The steps follow the way the error arises: the window
of the matcher averages disparity and so rounds grooves off; laser speckle adds noise that is alike over a few pixels and
stronger where the window sees relief; sub-pixel interpolation pulls towards whole pixels; disparity and depth are
stored in steps. Constants are fitted to a simulated stereo pair with matching, not to a real D415.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float32
from numpy import ndarray
from scipy.special import ndtri

from weldsim.errors import ConfigError, RecordError
from weldsim.quantity import Metre, Pixel
from weldsim.records import CameraIntrinsics
from weldsim.sensor.disparity import correlated_field, hidden_from_right, jitter_edges, near_edges, patches, support_average

Material = Literal["matte", "mill_scale", "ground", "black"]

MATERIALS: dict[Material, tuple[float, float]] = {
    "matte": (0.0, 1.0),
    "mill_scale": (0.01, 1.2),
    "ground": (0.08, 1.5),
    "black": (0.5, 2.0),
}
"""Share of the surface without return, and factor on the noise. Only matte is fitted; the others are guesses in order."""

D415_1280X720 = CameraIntrinsics(width=1280, height=720, fx=925.0, fy=925.0, cx=640.0, cy=360.0)
"""The depth imager's widest mode, nominal (640 x 480 as calibrated is `weldsim.mounts.D415_640X480`)."""

HOLE_SIZE = 12.0  # [px] correlation length of the holes on shiny or black surfaces
FARTHEST = 3.0  # [px] below this disparity (11 m at 640 x 480) the camera reports nothing


@dataclass(frozen=True, kw_only=True)
class D415Config:
    """The parametric D415. Defaults: 640 x 480, factory settings, matte surfaces."""

    baseline: Metre = 0.055
    """Distance between the two imagers."""
    disparity_sigma: Pixel = 0.075
    """Standard deviation of disparity on a matte plane (the maker quotes 0.08 for depth noise)."""
    correlation: Pixel = 5.3
    """Distance at which the correlation of the noise falls to 1/e."""
    window: int = 11
    """Side of the matcher's support window [px]; decides how far a groove is rounded off."""
    relief_gain: float = 1.0
    """Noise grows to (1 + gain) times where disparity varies by `relief_limit` or more inside the window."""
    relief_limit: Pixel = 0.8
    """Variation of disparity inside the window at which the growth of noise saturates."""
    pixel_locking: Pixel = 0.02
    """Amplitude A of the pull towards whole disparities, -A sin(2 pi d); real units lie in 0 to 0.12."""
    disparity_step: Pixel = 1 / 32
    """Disparity is stored in these steps; 0 = exact."""
    depth_unit: Metre = 0.001
    """Depth is stored in these steps; 0 = exact."""
    max_disparity: Pixel = 126.0
    """Search limit: nothing nearer than f * baseline / max_disparity is seen."""
    temporal_fraction: float = 0.3
    """Share of the noise's standard deviation that changes with each exposure; the rest stays with the view."""
    offset_sigma: Metre = 0.0
    """Standard deviation of an error of the whole view (calibration, pose); the thesis's ten distances suggest 3.5 mm."""
    offset_limit: float = 0.02
    """That error is cut off at this share of the distance (the maker's accuracy figure)."""
    edge_step: Pixel = 4.0
    """A step of disparity this large separates two surfaces; smaller ones are smeared."""
    edge_jitter: Pixel = 1.0
    """Standard deviation of where such an edge appears."""
    edge_dropout: float = 0.3
    """Share of the pixels beside such an edge that give no return."""
    material: Material = "matte"
    """What the workpiece is made of: holes and a factor on the noise."""

    def __post_init__(self) -> None:
        positive = ("baseline", "correlation", "window", "relief_limit", "max_disparity", "edge_step")
        for name in positive:
            if not getattr(self, name) > 0:
                raise ConfigError(f"sensor.{name}: {getattr(self, name)} must be positive", key=name, value=getattr(self, name))
        for name in (
            "disparity_sigma",
            "relief_gain",
            "disparity_step",
            "depth_unit",
            "offset_sigma",
            "offset_limit",
            "edge_jitter",
        ):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"sensor.{name}: {getattr(self, name)} must not be negative", key=name, value=getattr(self, name))
        for name in ("temporal_fraction", "edge_dropout"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"sensor.{name}: {getattr(self, name)} is outside 0 to 1", key=name, value=getattr(self, name))


def d415(
    exact: Float32[ndarray, "h w"],
    intrinsics: CameraIntrinsics,
    config: D415Config,
    *,
    seed: Sequence[int],
    exposure: int = 0,
    part: Bool[ndarray, "h w"] | None = None,
) -> Float32[ndarray, "h w"]:
    """Depth as the camera reports it [m], float32, NaN for no return.

    Args:
        exact: z-depth at pixel centres [m], NaN for nothing.
        intrinsics: of the depth image; the right imager is taken to have the same.
        seed: names the unit and the view; noise that does not change between exposures follows it.
        exposure: the rest of the noise follows this too.
        part: where `config.material` lies; None = everywhere.
    Raises:
        RecordError: `exact` is not of the size of the intrinsics.
    """
    shape = (intrinsics.height, intrinsics.width)
    if exact.shape != shape:
        raise RecordError(f"exact depth: shape {exact.shape}, intrinsics say {shape}", field="exact")
    c, scale = config, np.float32(intrinsics.fx * config.baseline)
    still, fresh = np.random.default_rng([*seed, 0]), np.random.default_rng([*seed, 1, exposure])
    offset = float(still.standard_normal()) * c.offset_sigma

    true = np.nan_to_num(scale / exact, nan=0.0, posinf=0.0)
    edges = near_edges(true, c.edge_step, 1 + round(c.edge_jitter))
    shown = jitter_edges(still, true, edges, c.edge_jitter)
    mean, spread = support_average(shown, c.window, c.edge_step)

    dropout, coarseness = MATERIALS[c.material]
    disparity = mean + _noise(spread, c, still, fresh) * _on_part(coarseness, part)
    if c.pixel_locking:
        disparity -= np.float32(c.pixel_locking) * np.sin(np.float32(2 * np.pi) * disparity)
    if c.disparity_step:
        disparity = np.rint(disparity / np.float32(c.disparity_step)) * np.float32(c.disparity_step)

    lost = (shown <= FARTHEST) | (disparity <= FARTHEST) | (disparity > c.max_disparity) | hidden_from_right(shown, c.edge_step)
    lost.reshape(-1)[edges[patches(fresh, shape, edges) < ndtri(c.edge_dropout)]] = True
    if dropout:
        holes = correlated_field(still, shape, HOLE_SIZE) < ndtri(dropout)
        lost |= holes if part is None else holes & part
    return _to_depth(scale / np.where(lost, np.float32(np.nan), disparity), offset, c)


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


def _on_part(factor: float, part: Bool[ndarray, "h w"] | None) -> np.float32 | Float32[ndarray, "h w"]:
    return np.float32(factor) if part is None else np.where(part, np.float32(factor), np.float32(1.0))


def _to_depth(depth: Float32[ndarray, "h w"], offset: float, c: D415Config) -> Float32[ndarray, "h w"]:
    """Depth with the view's own error, in steps of the depth unit."""
    if offset:
        seen = depth[np.isfinite(depth)]
        limit = c.offset_limit * float(seen.mean()) if seen.size else 0.0
        depth = depth + np.float32(np.clip(offset, -limit, limit))
    if c.depth_unit:
        depth = np.rint(depth / np.float32(c.depth_unit)) * np.float32(c.depth_unit)
    return np.where(depth > 0, depth, np.float32(np.nan)).astype(np.float32)
