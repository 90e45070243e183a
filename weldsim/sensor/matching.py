"""Disparity of a rectified pair of images: semi-global matching for the whole pixels, least squares for their fractions.

OpenCV's matcher alone pulls its fractions towards whole pixels by up to 0.2 px, more than a D415 errs; here it only finds
which pixel, and the fraction comes from the shift of a window that makes the images agree (Lucas and Kanade 1981).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.quantity import Pixel, require_within

SEARCH = 128  # [px] searched, and the width of the border added on the left: OpenCV gives nothing in that many columns
SGBM_BLOCK = 7  # [px]

RANGES = {
    "window": (3, 51),
    "blur": (0.0, 20.0),
    "iterations": (1, 50),
    "most_step": (0.01, 64.0),
    "least_correlation": (0.0, 0.999),
    "least_contrast": (0.0, 255.0),
    "uniqueness": (0, 100),
    "least_island": (0, 10_000),
}


@dataclass(frozen=True, kw_only=True)
class MatchingConfig:
    """How the simulated pair is matched."""

    window: int = 9
    """Side of the window whose shift is found [px]; decides how far a groove is rounded off."""
    blur: Pixel = 0.7
    """Blur of both images before that, as a Gaussian's deviation: interpolation is truer on smooth images."""
    iterations: int = 3
    """Steps of least squares."""
    most_step: Pixel = 1.5
    """A window that moves farther than this from the whole-pixel match is given up."""
    least_correlation: float = 0.6
    """A window whose images agree less than this (zero-mean normalised cross-correlation) gives no return."""
    least_contrast: float = 3.0
    """A window whose grey levels deviate less than this gives no return [DN]: nothing but noise is there."""
    uniqueness: int = 10
    """How much worse the second best whole-pixel match must be [%]."""
    least_island: int = 100
    """Islands of disparity smaller than this are removed, before and after the fractions are found [px2]."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "matching")
        if self.window % 2 == 0:
            raise ConfigError(f"matching.window: {self.window} must be odd", key="window", value=self.window)


def match(left: UInt8[ndarray, "h w"], right: UInt8[ndarray, "h w"], config: MatchingConfig) -> Float32[ndarray, "h w"]:
    """Disparity of each pixel of the left image [px], NaN for none; under SEARCH px."""
    from weldsim.sensor.subpixel import refine  # numba

    coarse = whole_pixels(left, right, config)
    smooth = [cv2.GaussianBlur(image.astype(np.float32), (0, 0), config.blur) if config.blur else image for image in (left, right)]
    out = np.full(coarse.shape, np.nan, np.float32)
    refine(
        np.ascontiguousarray(smooth[0], np.float32),
        np.ascontiguousarray(smooth[1], np.float32),
        coarse,
        config.window // 2,
        config.iterations,
        np.float32(config.most_step),
        np.float32(config.least_correlation),
        np.float32(config.least_contrast),
        out,
    )
    return without_islands(out, config.least_island)


def without_islands(disparity: Float32[ndarray, "h w"], area: int) -> Float32[ndarray, "h w"]:
    """The image with every patch of under `area` px2, set off from its surroundings by over 1 px, made NaN."""
    fixed = np.where(np.isfinite(disparity), disparity * 16, 0).astype(np.int16)
    cv2.filterSpeckles(fixed, 0, area, 16)
    return np.where(fixed > 0, disparity, np.float32(np.nan))


def whole_pixels(left: UInt8[ndarray, "h w"], right: UInt8[ndarray, "h w"], config: MatchingConfig) -> Float32[ndarray, "h w"]:
    """Disparity by semi-global matching [px], good to about 0.3 px; NaN where there is no match in the right image."""
    area = SGBM_BLOCK**2
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=SEARCH,
        blockSize=SGBM_BLOCK,
        P1=8 * area,
        P2=32 * area,
        disp12MaxDiff=1,
        uniquenessRatio=config.uniqueness,
        speckleWindowSize=config.least_island,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    padded = [cv2.copyMakeBorder(image, 0, 0, SEARCH, 0, cv2.BORDER_REPLICATE) for image in (left, right)]
    disparity = matcher.compute(*padded)[:, SEARCH:].astype(np.float32) / 16
    column = np.arange(left.shape[1], dtype=np.float32)
    return np.where((disparity > 0) & (column - disparity >= 0), disparity, np.float32(np.nan))
