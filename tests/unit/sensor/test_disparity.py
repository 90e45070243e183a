"""The pieces of the disparity model against slow and plain versions of themselves, on random images."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.sensor.disparity import correlated_field, hidden_from_right, jitter_edges, near_edges, support_average


def blocks(seed: int, shape: tuple[int, int] = (24, 31)) -> ndarray:
    """Random rectangles of disparity on a slanted ground, some without a surface (0)."""
    rng = np.random.default_rng(seed)
    image = (60 + 0.1 * np.arange(shape[1])[None, :] + 0.05 * np.arange(shape[0])[:, None]).astype(np.float32)
    for _ in range(6):
        r, c = rng.integers(0, shape[0] - 6), rng.integers(0, shape[1] - 6)
        image[r : r + rng.integers(2, 8), c : c + rng.integers(2, 8)] = rng.choice([0.0, 55.0, 61.5, 62.0, 70.0, 80.0])
    return image + np.where(image > 0, rng.normal(0, 0.2, shape), 0).astype(np.float32)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("window", [3, 5, 11])
def test_support_average_is_the_mean_of_its_own_surface(seed: int, window: int) -> None:
    image, step, half = blocks(seed), 4.0, window // 2
    mean, spread = support_average(image, window, step)
    padded = np.pad(image, half, mode="edge")
    for r, c in np.argwhere(image > 0):
        around = padded[r : r + window, c : c + window].astype(float)
        own = around[np.abs(around - image[r, c]) < step]
        assert mean[r, c] == pytest.approx(own.mean(), abs=1e-4)
        assert spread[r, c] == pytest.approx(np.ptp(own), abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_constant_surface_is_not_changed(seed: int) -> None:
    image = np.where(blocks(seed) > 60, 72.0, 0.0).astype(np.float32)
    mean, spread = support_average(image, 11, 4.0)
    assert mean[image > 0] == pytest.approx(72.0, abs=1e-5)
    assert spread[image > 0] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("length", [2.0, 5.3, 12.0])
def test_correlated_field_has_unit_variance_everywhere_and_the_length_asked_for(length: float) -> None:
    field = np.array([correlated_field(np.random.default_rng(seed), (120, 160), length) for seed in range(40)])
    assert abs(field.mean()) < 0.05
    assert field.std() == pytest.approx(1.0, abs=0.03)
    assert field[:, :4, :4].std() == pytest.approx(1.0, abs=0.25)  # the corners are no different
    lag = round(length)
    along = [np.mean(field[:, lag:] * field[:, :-lag]), np.mean(field[:, :, lag:] * field[:, :, :-lag])]
    assert along == pytest.approx([np.exp(-((lag / length) ** 2))] * 2, abs=0.05)


@pytest.mark.parametrize("seed", range(6))
def test_the_right_imager_sees_the_nearest_surface_on_each_of_its_lines_of_sight(seed: int) -> None:
    """Against a plain loop over surfaces of whole disparities, where columns meet exactly."""
    rng = np.random.default_rng(seed)
    image = np.full((8, 60), 12.0, np.float32)
    for _ in range(4):
        r, c = rng.integers(0, 5), rng.integers(14, 50)
        image[r : r + 3, c : c + rng.integers(3, 9)] = rng.choice([5.0, 20.0, 28.0])
    hidden = hidden_from_right(image, 4.0)
    for r in range(8):
        at = np.arange(60) - image[r].astype(int)
        for c in range(60):
            rivals = image[r][at == at[c]]
            if at[c] < 0 or rivals.max() - image[r, c] > 4.0:
                assert hidden[r, c]
            elif not (np.abs(at - at[c]) <= 2).sum() > (at == at[c]).sum() + 4:  # beside gaps of two the filling may hide more
                assert not hidden[r, c]


def test_edges_move_by_about_what_is_asked_and_surfaces_stay() -> None:
    image = np.full((400, 100), 70.0, np.float32)
    image[:, 50:] = 90.0
    edges = near_edges(image, 4.0, 3)
    assert set(edges % 100) == set(range(47, 53))
    moved = jitter_edges(np.random.default_rng(0), image, edges, 1.0)
    assert set(np.unique(moved)) == {70.0, 90.0}
    where = (moved == 70.0).sum(axis=1) - 50
    assert abs(where.mean()) < 0.3
    assert 0.4 < where.std() < 1.6
    assert near_edges(image, 25.0, 3).size == 0
