"""Depth pictures say what their colours mean: the scale's ends are depths, its colours those of the picture."""

import numpy as np
import pytest

from weldsim.sensor.portrait import _scale, _shaded, depth_range


def slope(near: float, far: float, rows: int = 200, columns: int = 600) -> np.ndarray:
    """A depth image that recedes evenly from left to right [m]."""
    return np.broadcast_to(np.linspace(near, far, columns, dtype=np.float32), (rows, columns)).copy()


@pytest.mark.parametrize(("near", "far"), [(0.3, 0.5), (0.4, 0.41), (1.0, 1.8)])
def test_the_range_is_that_of_what_is_seen(near: float, far: float) -> None:
    depth = slope(near, far)
    depth[:5] = np.nan
    depth[-3:] = 10.0  # far behind: another thing
    low, high = depth_range(depth)
    assert low == pytest.approx(near + 0.02 * (far - near), rel=0.02)
    assert high == pytest.approx(far - 0.02 * (far - near), rel=0.02)


def test_without_a_return_there_is_a_range_all_the_same() -> None:
    low, high = depth_range(np.full((4, 4), np.nan, np.float32))
    assert low < high


def test_the_bar_shows_the_colours_of_the_depths_between_its_ends() -> None:
    low, high = 0.30, 0.50
    picture = np.full((200, 600, 3), 255, np.uint8)
    _scale(picture, low, high)
    colours = _shaded(slope(low, high, rows=1, columns=110), low, high)[0].astype(int)
    row = picture[186].astype(int)  # amid the letters
    runs = [x for x in range(600 - 110) if np.abs(row[x : x + 110] - colours).max() <= 2]
    assert len(runs) == 1
    left, right = picture[170:200, : runs[0]], picture[170:200, runs[0] + 110 : 400]
    assert (left.min(axis=2) < 60).sum() > 30  # both ends are told
    assert (right.min(axis=2) < 60).sum() > 30


def test_no_return_is_black_and_near_is_bright() -> None:
    depth = slope(0.3, 0.5)
    depth[0, 0] = np.nan
    picture = _shaded(depth, 0.3, 0.5).astype(int)
    assert picture[0, 0].max() == 0
    assert picture[1, 5].sum() > picture[1, -5].sum()
