"""The driver's smoothing against a plain loop, and what it does to noise, edges and holes."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.sensor.spatial_filter import ALPHA, DELTA, PASSES, spatially_filtered


def swept(line: ndarray) -> ndarray:
    """One sweep along a line: each value is mixed with the result before it where the values themselves are near."""
    out = line.copy()
    for k in range(1, len(line)):
        if abs(line[k] - line[k - 1]) < DELTA:
            out[k] = ALPHA * line[k] + (1 - ALPHA) * out[k - 1]
    return out


def slowly(image: ndarray) -> ndarray:
    for _ in range(PASSES):
        for turned in (False, True):  # rows, then columns
            lines = image.T if turned else image
            lines = np.array([swept(swept(line)[::-1])[::-1] for line in lines])
            image = lines.T if turned else lines
    return image


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_recursive_filter_there_and_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = (60 + rng.normal(0, 0.3, (17, 23))).astype(np.float32)
    image[5:9, 8:] += 3.0
    image[rng.random(image.shape) < 0.1] = np.nan
    assert spatially_filtered(image) == pytest.approx(slowly(image.astype(float)), abs=1e-4, nan_ok=True)


def test_noise_is_smoothed_and_edges_and_holes_stay() -> None:
    rng = np.random.default_rng(0)
    image = (60 + rng.normal(0, 0.1, (60, 80))).astype(np.float32)
    image[:, 40:] += 2.0
    image[20:25, 10:15] = np.nan
    before = image.copy()
    smooth = spatially_filtered(image)
    assert np.array_equal(image, before, equal_nan=True)  # a new image
    assert np.array_equal(np.isnan(smooth), np.isnan(image))
    assert np.nanstd(smooth[:, :40]) < 0.4 * np.nanstd(image[:, :40])
    assert np.nanmean(smooth[:, 39]) == pytest.approx(60.0, abs=0.06)
    assert np.nanmean(smooth[:, 40]) == pytest.approx(62.0, abs=0.06)
