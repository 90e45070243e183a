"""Infrared images as the imagers of an active-stereo camera take them: dots thrown on surfaces, blurred, with noise.

Pure functions on arrays of what rays have met. The projector's pattern is our own (its real one is not published), shaded by
Lambert's law with a Phong highlight for bare metal; laser speckle stands still with the view and differs between the
imagers, shot and read noise change with each exposure. Light that bounces between surfaces is left out.
"""

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray

from weldsim.quantity import Metre, Pixel, Radian, require_within
from weldsim.sensor.base import Finish
from weldsim.sensor.disparity import correlated_field
from weldsim.sensor.renderer import dot, lengths

REFLECTANCE: dict[Finish, tuple[float, float, float]] = {
    Finish.MATTE: (0.50, 0.0, 1.0),
    Finish.MILL_SCALE: (0.20, 0.3, 30.0),
    Finish.GROUND: (0.10, 4.0, 200.0),
    Finish.BLACK: (0.03, 0.05, 20.0),
}
"""Diffuse albedo, strength of the highlight and its Phong exponent at 850 nm. Assumed, not measured: isotropic and smooth,
which flatters brushed steel."""

TEXELS = 1400.0  # [px] focal length of the pattern's image: a dot's deviation is then 1.8 texels
REFERENCE = 0.4  # [m] distance at which the laser lights as strongly as `laser` says
DOTS_AT_FOCAL = 925.0  # [px] focal length at which `dot_sigma` is stated

RANGES = {
    "dots": (100, 1_000_000),
    "dot_sigma": (0.1, 20.0),
    "projector_width": (0.05, 2.1),
    "projector_height": (0.05, 2.1),
    "projector_x": (-0.5, 0.5),
    "lens_sigma": (0.0, 20.0),
    "speckle": (0.0, 2.0),
    "speckle_size": (0.05, 20.0),
    "ambient": (0.0, 100.0),
    "exposure": (1.0, 255.0),
    "most_gain": (0.01, 1e4),
    "electrons": (0.01, 1e6),
    "read_noise": (0.0, 100.0),
}


@dataclass(frozen=True, kw_only=True)
class InfraredConfig:
    """Projector and imagers of the simulated pair. Fitted to the maker's noise law by `speckle` alone; the rest is assumed."""

    dots: int = 16000
    """Dots in the projector's field (the D435's has about 5000 and the D415's more; its number is not published)."""
    dot_sigma: Pixel = 1.2
    """Radius of a dot, as a Gaussian's deviation in a 1280 x 720 image."""
    projector_width: Radian = 1.169370599
    """Horizontal field of the projector (67 deg, the maker's data sheet)."""
    projector_height: Radian = 0.715584993
    """Vertical field of the projector (41 deg, the maker's data sheet): the outermost rows of a 640 x 480 image stay dark."""
    projector_x: Metre = 0.0275
    """Where the projector stands between left imager (0) and right; half-way is assumed."""
    lens_sigma: Pixel = 0.8
    """Blur of the lens, as a Gaussian's deviation."""
    speckle: float = 0.15
    """Contrast of laser speckle in a pixel."""
    speckle_size: Pixel = 0.5
    """Size of a speckle grain, as a Gaussian's deviation."""
    ambient: float = 0.08
    """Light that is not the projector's, over its mean light at 0.4 m."""
    exposure: float = 50.0
    """Mean grey level that automatic exposure aims at [DN of 255]."""
    most_gain: float = 8.0
    """Longest exposure, over that of a matte surface at 0.4 m."""
    electrons: float = 30.0
    """Electrons a grey level, for shot noise."""
    read_noise: float = 1.2
    """Standard deviation of read noise [DN]."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "infrared")


@lru_cache(maxsize=4)
def dot_pattern(config: InfraredConfig, seed: int) -> Float32[ndarray, "m n"]:
    """The projector's image, mean 1: dots of uneven strength, one at a random place in each cell of a grid.

    Pixel (u, v) lies in direction ((u - n/2 + 1/2) / TEXELS, (v - m/2 + 1/2) / TEXELS, 1) of the projector.
    """
    rng = np.random.default_rng([0x1A5E2, seed])
    half = TEXELS * np.tan(np.array([config.projector_height, config.projector_width]) / 2)
    height, width = (2 * np.ceil(half)).astype(int)
    cell = np.sqrt(height * width / config.dots)
    rows, columns = np.meshgrid(np.arange(0, height, cell), np.arange(0, width, cell), indexing="ij")
    v, u = rows + rng.uniform(0, cell, rows.shape), columns + rng.uniform(0, cell, rows.shape)
    strength = rng.uniform(0.5, 1.5, rows.shape)
    image = np.zeros((height + 2, width + 2), np.float32)
    v, u, strength = (a[(v < height) & (u < width)] for a in (v, u, strength))
    row, column = v.astype(int), u.astype(int)
    for dv in (0, 1):
        for du in (0, 1):
            share = np.abs(1 - dv - (v - row)) * np.abs(1 - du - (u - column))
            np.add.at(image, (row + dv, column + du), (strength * share).astype(np.float32))
    image = cv2.GaussianBlur(image, (0, 0), config.dot_sigma * TEXELS / DOTS_AT_FOCAL)[:height, :width]
    return image / image.mean()


def reflected(
    z: Float32[ndarray, "h w"],
    rays: Float32[ndarray, "h w 3"],
    normals: Float32[ndarray, "h w 3"],
    lamp: Float32[ndarray, "3"],
    lit: ndarray,
    finishes: ndarray,
    config: InfraredConfig,
    pattern: Float32[ndarray, "m n"],
) -> tuple[Float32[ndarray, "h w"], Float32[ndarray, "h w"]]:
    """Light from each pixel's surface to the imager: the projector's, and the ambient light's.

    Everything is in the imager's optical frame. 1 is the mean of a white surface facing the projector at 0.4 m.

    Args:
        z: depth [m], inf for nothing.  rays: through the pixels, z = 1.  normals: unit, either side.
        lamp: the projector [m]; its axes are the imager's.  lit: what it reaches.  finishes: a `Finish` a pixel.
        config, pattern: the projector.
    """
    seen = np.isfinite(z)
    points = rays * np.where(seen, z, np.float32(1.0))[..., None]
    towards = lamp - points
    distance = lengths(towards)
    towards /= distance[..., None]
    view = -rays / lengths(rays)[..., None]
    facing = dot(normals, view)
    normals = normals * np.where(facing < 0, np.float32(-1), np.float32(1))[..., None]
    cosine = np.clip(dot(normals, towards), 0, None)

    from_lamp = points - lamp
    map_u = from_lamp[..., 0] / from_lamp[..., 2] * np.float32(TEXELS) + np.float32(pattern.shape[1] / 2 - 0.5)
    map_v = from_lamp[..., 1] / from_lamp[..., 2] * np.float32(TEXELS) + np.float32(pattern.shape[0] / 2 - 0.5)
    dots = cv2.remap(pattern, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
    lamp_light = dots * lit * np.float32(REFERENCE**2) / distance**2

    albedo = _TABLE[finishes, 0]
    laser = albedo * cosine * lamp_light
    if finishes.any():
        mirrored = 2 * cosine[..., None] * normals - towards
        lobe = np.clip(dot(mirrored, view), 0, 1) ** _TABLE[finishes, 2]
        laser += _TABLE[finishes, 1] * lobe * (cosine > 0) * lamp_light
    zero = np.float32(0)
    return np.where(seen, laser, zero), np.where(seen, albedo * np.float32(config.ambient), zero)


_TABLE = np.array([REFLECTANCE[finish] for finish in Finish], np.float32)


def gain(light: Float32[ndarray, "h w"], config: InfraredConfig) -> float:
    """Grey levels [DN] a unit of light that automatic exposure settles on; highlights count as thrice the mean at most."""
    mean = float(light.mean())
    level = float(np.minimum(light, 3 * mean).mean())
    longest = config.most_gain * config.exposure / REFLECTANCE[Finish.MATTE][0]
    return min(config.exposure / level, longest) if level > 0 else longest


def infrared_image(
    laser: Float32[ndarray, "h w"],
    ambient: Float32[ndarray, "h w"],
    scale: float,
    config: InfraredConfig,
    still: np.random.Generator,
    fresh: np.random.Generator,
) -> UInt8[ndarray, "h w"]:
    """Grey levels: speckle on the laser's light, lens blur, shot and read noise, 8 bits.

    Args:
        laser, ambient: as `reflected` gives them.  scale: as `gain` gives it.
        still: of what stays with the view (speckle).  fresh: of what changes with each exposure.
    """
    speckle = np.clip(1 + np.float32(config.speckle) * correlated_field(still, laser.shape, 2 * config.speckle_size), 0, None)
    image = laser + ambient
    if config.lens_sigma:
        image = cv2.GaussianBlur(image, (0, 0), config.lens_sigma)
    share = laser.mean() / max(laser.mean() + ambient.mean(), 1e-9)
    level = np.float32(scale) * image * (1 + np.float32(share) * (speckle - 1))
    sigma = np.sqrt(level / np.float32(config.electrons) + np.float32(config.read_noise**2))
    level += sigma * fresh.standard_normal(laser.shape, dtype=np.float32)
    return np.clip(np.rint(level), 0, 255).astype(np.uint8)
