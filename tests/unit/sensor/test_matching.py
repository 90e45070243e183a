"""Matching of image pairs whose disparity is known: dots shifted by a known amount, no rendering."""

import cv2
import numpy as np
import pytest
from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.sensor.infrared import InfraredConfig, dot_pattern
from weldsim.sensor.matching import MatchingConfig, match, whole_pixels, without_islands

SIZE = (120, 320)


def pair(disparity: ndarray, seed: int, noise: float = 1.0) -> tuple[ndarray, ndarray]:
    """Left and right image of the projector's dots; the right one shows at u - d what the left one shows at u."""
    texture = 50 * dot_pattern(InfraredConfig(), seed)[:500, :1000]
    v, u = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    rng = np.random.default_rng(seed)
    right = cv2.remap(texture, 2 * u + 300, 2 * v + 50, cv2.INTER_LINEAR)
    left = cv2.remap(texture, (2 * (u - disparity) + 300).astype(np.float32), 2 * v + 50, cv2.INTER_LINEAR)
    images = [cv2.GaussianBlur(image, (0, 0), 0.8) + noise * rng.standard_normal(SIZE) for image in (left, right)]
    return images[0].clip(0, 255).astype(np.uint8), images[1].clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5, 0.75])
def test_fractions_are_found_without_a_pull_to_whole_pixels(fraction: float) -> None:
    """Within 0.02 px on average, where OpenCV's own fractions are off by up to 0.2."""
    disparity = np.full(SIZE, 60 + fraction, np.float32)
    biases = []
    for seed in range(3):
        found = match(*pair(disparity, seed), MatchingConfig())[10:-10, 90:-20]
        assert np.isfinite(found).mean() > 0.99
        biases.append(np.nanmean(found) - 60 - fraction)
        assert np.nanstd(found) < 0.05
    assert abs(np.mean(biases)) < 0.02


def test_the_border_is_where_the_right_image_ends() -> None:
    found = match(*pair(np.full(SIZE, 70.3, np.float32), 0), MatchingConfig())
    first = np.isfinite(found).argmax(axis=1)[5:-5]
    assert first.min() >= 70
    assert np.median(first) <= 74


def test_a_slope_is_followed_and_a_step_keeps_its_sides() -> None:
    u = np.mgrid[: SIZE[0], : SIZE[1]][1]
    slope = (50 + 0.03 * u).astype(np.float32)
    error = match(*pair(slope, 1), MatchingConfig())[10:-10, 90:-20] - slope[10:-10, 90:-20]
    assert abs(np.nanmean(error)) < 0.02
    step = np.where(u < 200, 50.0, 62.0).astype(np.float32)
    found = match(*pair(step, 2), MatchingConfig())
    assert np.nanmedian(found[:, 80:180]) == pytest.approx(50, abs=0.05)
    assert np.nanmedian(found[:, 215:300]) == pytest.approx(62, abs=0.05)
    assert np.mean((found > 52) & (found < 60)) < 2e-3


def test_noise_alone_gives_no_return() -> None:
    rng = np.random.default_rng(3)
    dark = [rng.integers(3, 8, SIZE).astype(np.uint8) for _ in range(2)]
    assert np.isnan(match(dark[0], dark[1], MatchingConfig())).mean() > 0.99
    flat = np.full(SIZE, 80, np.uint8)
    assert np.isnan(match(flat, flat, MatchingConfig())).all()
    light = [rng.integers(0, 255, SIZE).astype(np.uint8) for _ in range(2)]
    assert np.isnan(match(light[0], light[1], MatchingConfig())).mean() > 0.95


def test_whole_pixels_are_near() -> None:
    disparity = np.full(SIZE, 44.0, np.float32)
    found = whole_pixels(*pair(disparity, 4), MatchingConfig())[10:-10, 60:-20]
    assert np.isfinite(found).mean() > 0.97
    assert np.nanmax(np.abs(found - 44)) < 1


def test_islands_go_and_land_stays() -> None:
    image = np.full((60, 80), 50.0, np.float32)
    image[20:25, 20:25] = 70.0  # 25 px2
    image[40:55, 40:60] = 70.0  # 300 px2
    image[:10] = np.nan
    kept = without_islands(image, 100)
    assert np.isnan(kept[20:25, 20:25]).all()
    assert (kept[40:55, 40:60] == 70).all()
    assert np.isnan(kept[:10]).all()
    assert np.isnan(kept).sum() == 25 + 800


@pytest.mark.parametrize(("key", "value"), [("window", 8), ("window", 1), ("iterations", 0), ("least_correlation", 1.0)])
def test_impossible_settings_are_refused(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        MatchingConfig(**{key: value})
