"""Ways through the air found by random search: clear all along, from start to goal, the same every time."""

from itertools import pairwise

import numpy as np
import pytest

from weldsim.motion.roam import roam
from weldsim.motion.sweep import STEP_TURN as STEP
from weldsim.motion.sweep import touched

WALL = 0.3  # [rad] half the thickness of the wall between start and goal


def walled(gap: float, less: float = 0.0):
    """Blocks |q0| < WALL but where q1 exceeds `gap`; a wall smaller by `less` all round."""
    return lambda q: "wall" if abs(q[0]) < WALL - less and q[1] < gap - less else None


@pytest.mark.parametrize("seed", range(6))
def test_a_way_round_is_clear_all_along(seed):
    rng = np.random.default_rng(seed)
    start, goal = rng.uniform(-0.5, 0.5, 6), rng.uniform(-0.5, 0.5, 6)
    start[0], goal[0] = -1.0, 1.0
    blocked = walled(0.8)
    assert touched(start, goal, blocked) == "wall"
    corners = roam(start, goal, blocked, seed=seed)
    assert corners is not None
    np.testing.assert_array_equal(corners[0], start)
    np.testing.assert_array_equal(corners[-1], goal)
    for a, b in pairwise(corners):
        # A corner may be cut by less than the distance between two looks.
        assert all(walled(0.8, STEP)(a + u * (b - a)) is None for u in np.linspace(0, 1, 200))
    again = roam(start, goal, blocked, seed=seed)
    assert again is not None
    np.testing.assert_array_equal(np.array(again), np.array(corners))
    # Cutting corners leaves no more than a fair detour over the wall's top.
    assert sum(np.abs(b - a).max() for a, b in pairwise(corners)) < 8.0


def test_a_free_way_is_straight():
    start, goal = np.zeros(6), np.full(6, 0.7)
    corners = roam(start, goal, lambda q: None)
    assert corners is not None
    assert len(corners) == 2


def test_where_there_is_no_way_none_is_given():
    start, goal = np.zeros(6), np.zeros(6)
    start[0], goal[0] = -1.0, 1.0
    assert roam(start, goal, walled(99.0), tries=150) is None
    assert roam(np.zeros(6), goal, walled(99.0)) is None  # it starts inside
