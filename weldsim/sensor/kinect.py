"""Depth as a Kinect v2 reports it: phases of modulated light, mixed where a pixel sees two surfaces, then the driver's filters.

Pure functions on images of range and amplitude finer than the sensor's pixels. What a pixel receives is a sum of phasors, so
edges give pixels that hang between the surfaces and bounced light pulls corners out of shape, as in the real camera.
The noise law is a published fit; the modulation frequencies and the filter's rule are ours; nothing is fitted to a real unit.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Bool, Complex64, Float, Float32
from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.quantity import Metre, Pixel, require_within

LIGHT = 299792458.0  # [m/s]
FREQUENCIES = (16e6, 80e6, 120e6)  # [Hz] assumed; three are used, the lowest without ambiguity up to 9.4 m
SMOOTHING = np.array([0.107, 0.113, 0.107, 0.113, 0.120, 0.113, 0.107, 0.113, 0.107], np.float32)  # libfreenect2's default
ALIKE = 0.03  # [m] neighbours within this are smoothed together
GRAZING = np.radians(85.0)  # the noise law has a pole at 90 deg: angles are cut off here

RANGES = {
    "blur": (0.0, 20.0),
    "noise": (0.0, 100.0),
    "offset": (-0.2, 0.2),
    "wiggling": (0.0, 1.0),
    "wiggling_period": (0.01, 10.0),
    "bounces": (0, 256),
    "edge_near": (1e-4, 10.0),
    "edge_far": (1e-4, 10.0),
    "edge_alone": (1e-4, 10.0),
    "edge_count": (0, 9),
    "nearest": (0.01, 9.4),
    "farthest": (0.02, 9.4),
    "depth_unit": (0.0, 0.1),
}


@dataclass(frozen=True, kw_only=True)
class KinectConfig:
    """The simulated Kinect v2. Defaults: the driver's filters on, a calibrated unit, direct light only."""

    supersample: Literal[1, 2, 3] = 2
    """Rays a pixel along each axis; 3 is the reference, 1 knows no mixed pixels."""
    blur: Pixel = 0.5
    """Blur of the lens, as a Gaussian's deviation; assumed."""
    noise: float = 1.0
    """Factor on the noise law sigma(z, angle) of Fankhauser et al. 2015."""
    offset: Metre = 0.0
    """Error of range, the same everywhere; +24 mm on one unit without calibration (libfreenect2 issue 144)."""
    wiggling: Metre = 0.0
    """Amplitude of the periodic error of range; its presence is known (Corti et al. 2016), its size is not."""
    wiggling_period: Metre = 0.47
    """Its period: a quarter of the 80 MHz ambiguity range, assumed."""
    bounces: int = 0
    """Rays a pixel for light that comes by way of a second surface; 0 = none, 8 are enough."""
    smoothing: bool = True
    """The driver's 3 x 3 filter, which does not reach across steps of over 30 mm."""
    edge_filter: bool = True
    """Drop pixels that hang between two surfaces or stand alone."""
    edge_near: Metre = 0.050
    """A hanging pixel has a neighbour nearer by more than this (libfreenect2's figure) ..."""
    edge_far: Metre = 0.030
    """... and one farther by more than this (libfreenect2's figure)."""
    edge_alone: Metre = 0.100
    """A pixel stands alone that differs by more than this from `edge_count` of its neighbours (libfreenect2's figures)."""
    edge_count: int = 5
    """See `edge_alone`."""
    nearest: Metre = 0.5
    """Nothing nearer is reported (driver)."""
    farthest: Metre = 4.5
    """Nothing farther is reported (driver)."""
    depth_unit: Metre = 0.001
    """Depth is stored in these steps; 0 = exact."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "kinect")
        if not self.nearest < self.farthest:
            raise ConfigError(
                f"kinect.farthest: {self.farthest} m is not beyond nearest, {self.nearest} m", key="farthest", value=self.farthest
            )


def axial_sigma(z: Float[ndarray, "*n"], angle: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """Standard deviation of depth [m] at depth z [m] on a surface turned by `angle` [rad] from facing the camera.

    Fankhauser et al. 2015: 1.5 - 0.5 z + 0.3 z^2 + 0.1 z^1.5 angle^2 / (pi/2 - angle)^2 millimetres, z in metres.
    """
    angle = np.minimum(angle, GRAZING)
    tilted = z * np.sqrt(z) * (angle / (np.pi / 2 - angle)) ** 2
    return 1e-3 * (1.5 - 0.5 * z + 0.3 * z**2 + 0.1 * tilted)


def phasors(
    reach: Float32[ndarray, "hs ws"], amplitude: Float32[ndarray, "hs ws"], supersample: int, blur: float
) -> list[Complex64[ndarray, "h w"]]:
    """What each pixel receives at each frequency: the mean of amplitude e^(i 4 pi f range / c) over its samples, blurred.

    Args:
        reach: distance along the ray [m], anything finite where amplitude is 0.  amplitude: of the light that returns.
        supersample: samples a pixel along each axis.  blur: of the lens [px].
    """
    size = (reach.shape[1] // supersample, reach.shape[0] // supersample)
    out = []
    for frequency in FREQUENCIES:
        parts = cv2.polarToCart(amplitude, np.float32(4 * np.pi * frequency / LIGHT) * reach)
        if blur:
            parts = [cv2.GaussianBlur(part, (0, 0), blur * supersample) for part in parts]
        if supersample > 1:
            parts = [cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in parts]
        out.append((parts[0] + np.complex64(1j) * parts[1]).astype(np.complex64))
    return out


def unwrapped(received: list[Complex64[ndarray, "h w"]]) -> Float32[ndarray, "h w"]:
    """Range [m]: the coarse one of the lowest frequency tells the turns of the next; the highest two count, by frequency^2."""
    coarse, total, weights = None, None, 0.0
    for frequency, phasor in zip(FREQUENCIES, received, strict=True):
        turn = LIGHT / (2 * frequency)
        reach = (np.angle(phasor) % (2 * np.pi)).astype(np.float32) * np.float32(turn / (2 * np.pi))
        if coarse is None:
            coarse = reach
            continue
        coarse = reach + np.float32(turn) * np.rint((coarse - reach) / np.float32(turn))
        total = frequency**2 * coarse if total is None else total + frequency**2 * coarse
        weights += frequency**2
    if total is None:
        raise AssertionError("fewer than two frequencies")
    return (total / weights).astype(np.float32)


def smoothed(received: list[Complex64[ndarray, "h w"]], reach: Float32[ndarray, "h w"]) -> list[Complex64[ndarray, "h w"]]:
    """Each phasor averaged with those of its eight neighbours whose range [m] is alike."""
    height, width = reach.shape
    around = [np.pad(image, 1, mode="edge") for image in (reach, *received)]
    out = [np.zeros_like(image) for image in received]
    for weight, (dv, du) in zip(SMOOTHING, np.ndindex(3, 3), strict=True):
        window = np.s_[dv : dv + height, du : du + width]
        share = np.where(np.abs(around[0][window] - reach) < ALIKE, weight, np.float32(0))
        for total, image in zip(out, around[1:], strict=True):
            total += share * image[window]
    return out


def hanging(z: Float32[ndarray, "h w"], config: KinectConfig) -> Bool[ndarray, "h w"]:
    """Pixels between two surfaces, or unlike most of their neighbours; a neighbour without return counts as alike."""
    height, width = z.shape
    padded = np.pad(np.where(np.isfinite(z), z, np.float32(np.nan)), 1, mode="edge")
    most, least, unlike = np.zeros_like(z), np.zeros_like(z), np.zeros(z.shape, np.uint8)
    for dv, du in np.ndindex(3, 3):
        difference = np.nan_to_num(padded[dv : dv + height, du : du + width] - z)
        np.maximum(most, difference, out=most)
        np.minimum(least, difference, out=least)
        unlike += np.abs(difference) > config.edge_alone
    return ((least < -config.edge_near) & (most > config.edge_far)) | (unlike >= config.edge_count)


def kinect_depth(
    received: list[Complex64[ndarray, "h w"]],
    lengths: Float32[ndarray, "h w"],
    angle: Float32[ndarray, "h w"],
    config: KinectConfig,
    fresh: np.random.Generator,
) -> Float32[ndarray, "h w"]:
    """Depth as the driver gives it [m], float32, NaN for no return.

    Args:
        received: as `phasors` gives them.  lengths: of each pixel's ray with z = 1.
        angle: of the surface from facing the camera [rad].  fresh: of the noise, all of which changes between exposures.
    """
    c, seen = config, np.abs(received[0]) > 0
    reach = unwrapped(received)
    if c.smoothing:
        reach = unwrapped(smoothed(received, reach))
    if c.wiggling:
        reach = reach + np.float32(c.wiggling) * np.sin(np.float32(2 * np.pi / c.wiggling_period) * reach)
    z = np.where(seen, (reach + np.float32(c.offset)) / lengths, np.float32(np.nan))
    white = fresh.standard_normal(z.shape, dtype=np.float32)
    if c.smoothing:
        kernel = SMOOTHING.reshape(3, 3) / np.linalg.norm(SMOOTHING)
        white = cv2.filter2D(white, cv2.CV_32F, kernel, borderType=cv2.BORDER_REFLECT)
    z = z + (np.float32(c.noise) * axial_sigma(z, angle) * white).astype(np.float32)
    if c.edge_filter:
        z[hanging(z, c)] = np.nan
    if c.depth_unit:
        z = np.rint(z / np.float32(c.depth_unit)) * np.float32(c.depth_unit)
    return np.where((z >= c.nearest) & (z <= c.farthest), z, np.float32(np.nan)).astype(np.float32)
