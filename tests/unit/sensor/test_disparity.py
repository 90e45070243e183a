"""The pieces of the disparity model against slow and plain versions of themselves, on random images."""

import numpy as np
import pytest
from numpy import ndarray

from weldsim.sensor.disparity import (
    correlated_field,
    hidden_from_right,
    jitter_edges,
    left_of,
    mixed_rims,
    near_edges,
    support_average,
)


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
    mean, relief = support_average(image, window, step)
    padded = np.pad(image, half, mode="edge")
    left = np.pad(np.where(image > 0, image - mean, 0.0), half, mode="edge")
    for r, c in np.argwhere(image > 0):
        around = padded[r : r + window, c : c + window].astype(float)
        own = around[np.abs(around - image[r, c]) < step]
        assert mean[r, c] == pytest.approx(own.mean(), abs=1e-4)
        assert relief[r, c] == pytest.approx(np.ptp(left[r : r + window, c : c + window]), abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_a_constant_surface_is_not_changed(seed: int) -> None:
    image = np.where(blocks(seed) > 60, 72.0, 0.0).astype(np.float32)
    mean, relief = support_average(image, 11, 4.0)
    assert mean[image > 0] == pytest.approx(72.0, abs=1e-5)
    assert relief == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("down", "along"), [(0.0, 0.0), (0.08, 0.0), (-0.05, 0.2)])
def test_a_plane_has_no_relief_however_it_is_tilted_and_a_ridge_has(down: float, along: float) -> None:
    rows, columns = np.indices((60, 80))
    plane = (60 + down * rows + along * columns).astype(np.float32)
    mean, relief = support_average(plane, 11, 4.0)
    assert np.abs(mean - plane)[6:-6, 6:-6].max() < 1e-4
    assert relief[11:-11, 11:-11].max() < 1e-4
    ridge = plane + np.maximum(1 - np.abs(columns - 40) / 5, 0).astype(np.float32)
    relief = support_average(ridge, 11, 4.0)[1]
    assert 0.6 < relief[30, 40] < 1.1
    assert relief[30, 11:20].max() < 1e-4


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


def test_shadows_are_widened_to_their_left_alone_and_by_what_is_asked() -> None:
    hidden = np.zeros((400, 60), bool)
    hidden[:, 30:40] = True
    hidden[:, :5] = True  # a run at the border has nothing to its left
    found = np.zeros_like(hidden)
    found.reshape(-1)[left_of(np.random.default_rng(0), hidden, 1.3)] = True
    assert set(np.flatnonzero(found.any(axis=0))) <= {27, 28, 29}
    assert found[:, 29].mean() > found[:, 28].mean() > found[:, 27].mean()
    assert found.sum(axis=1).mean() == pytest.approx(1.3, abs=0.15)
    close = np.zeros((8, 20), bool)
    close[:, 1] = True
    rows, columns = np.divmod(left_of(np.random.default_rng(0), close, 5.0), 20)
    assert set(columns) == {0}  # not round to the row above
    assert set(rows) == set(range(8))
    assert left_of(np.random.default_rng(0), np.zeros((8, 20), bool), 1.3).size == 0


def test_rims_show_now_and_then_what_lies_between_two_surfaces() -> None:
    image = np.full((600, 80), 70.0, np.float32)
    image[:, 30:50] = 90.0
    image[:, 60:] = 0.0  # beside nothing there is nothing to mix
    seen = np.ones(image.shape, bool)
    seen[300:, 49] = False
    pixels, between = mixed_rims(np.random.default_rng(0), image, seen, 4.0, 0.2)
    columns = pixels % 80
    assert set(columns) == {30, 49}  # on the nearer side
    assert (columns == 30).mean() == pytest.approx(2 / 3, abs=0.1)
    assert len(pixels) / 900 == pytest.approx(0.2, abs=0.05)
    assert between.min() > 70.0
    assert between.max() < 90.0
    assert between.mean() == pytest.approx(80.0, abs=2.0)
    turned, _ = mixed_rims(np.random.default_rng(0), np.ascontiguousarray(image.T), np.ascontiguousarray(seen.T), 4.0, 0.2)
    assert set(turned // 600) == {30, 49}
    assert mixed_rims(np.random.default_rng(0), image, seen, 25.0, 1.0)[0].size == 0
