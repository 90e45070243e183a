"""Directions along a line in closed form: which side, what smoothing keeps, how a limited turn goes."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import norm

from weldsim.frames import unit
from weldsim.path.directions import limited, one_sided, smooth, turn


def leaning(angle: np.ndarray) -> np.ndarray:
    """Unit directions in the x-z plane, at an angle [rad] from straight down."""
    return np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1)


def angle_of(directions: np.ndarray) -> np.ndarray:
    """From straight down towards x [rad]; the directions are unit and lie in the x-z plane."""
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(directions[:, 1], 0.0, atol=1e-12)
    return np.arctan2(directions[:, 0], -directions[:, 2])


def uneven(start: float, stop: float, seed: int) -> np.ndarray:
    """Arc lengths [m] 0.1 to 1 mm apart."""
    steps = np.random.default_rng(seed).uniform(1e-4, 1e-3, 1000)
    s = start + np.concatenate([[0.0], np.cumsum(steps)])
    return s[s < stop]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("step", [0.5, -0.9, 1.4])
def test_a_step_becomes_a_turn_at_the_limits_rate_with_its_middle_at_the_step(step: float, seed: int) -> None:
    rate, at = 20.0, 0.1
    s = uneven(0.0, 0.2, seed)
    found = angle_of(limited(s, leaning(np.where(s < at, 0.0, step)), rate))
    half = abs(step) / (2 * rate)  # [m] the turn takes |step| / rate of arc length, half of it before the step
    wanted = step * np.clip((s - (at - half)) / (2 * half), 0.0, 1.0)
    # The step lies somewhere between two samples, at most 1 mm apart.
    np.testing.assert_allclose(found, wanted, atol=1.1e-3 * rate)
    turning = (s > at - half + 2e-3) & (s < at + half - 2e-3)
    np.testing.assert_allclose(np.diff(found[turning]) / np.diff(s[turning]), np.sign(step) * rate, rtol=1e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("step", [0.9, -1.5])
def test_an_eased_turn_begins_and_ends_gradually_and_never_exceeds_the_limit(step: float, seed: int) -> None:
    """Its rate is the limit's where the turn is, smoothed by a Gaussian of that standard deviation."""
    rate, at, ease = 20.0, 0.1, 0.004
    s = uneven(0.0, 0.2, seed)
    directions = leaning(np.where(s < at, 0.0, step))
    found = angle_of(limited(s, directions, rate, ease))
    half = abs(step) / (2 * rate)
    middle = (s[:-1] + s[1:]) / 2
    wanted = np.sign(step) * rate * (norm.cdf((middle - at + half) / ease) - norm.cdf((middle - at - half) / ease))
    np.testing.assert_allclose(np.diff(found) / np.diff(s), wanted, atol=0.1 * rate)
    assert (np.abs(np.diff(found)) <= rate * np.diff(s) + 1e-9).all()
    assert np.abs(np.diff(angle_of(limited(s, directions, rate))) / np.diff(s) - wanted).max() > 0.4 * rate
    np.testing.assert_allclose(found[[0, -1]], [0.0, step], atol=1e-6)


@pytest.mark.parametrize("ease", [0.002, 0.005])
def test_an_eased_turn_at_an_end_of_the_line_keeps_the_limit(ease: float) -> None:
    for seed, at in product(range(4), (0.002, 0.01, 0.095)):
        s = uneven(0.0, 0.1, seed)
        found = limited(s, leaning(np.where(s < at, 0.0, 1.2)), 20.0, ease)
        assert (turn(found) <= 20.0 * np.diff(s) + 1e-9).all()


@pytest.mark.parametrize("seed", range(3))
def test_a_bump_too_short_for_the_limit_becomes_a_lower_one_about_the_same_place(seed: int) -> None:
    """Out by 1 rad over 10 mm and back: neither limiter, at twice the rate, gets farther than 0.4 rad; their middle is 0.2."""
    rate, start, stop = 20.0, 0.10, 0.11
    s = uneven(0.0, 0.2, seed)
    found = angle_of(limited(s, leaning(np.where((s >= start) & (s < stop), 1.0, 0.0)), rate))
    wanted = rate * np.clip(np.minimum(s - (start - 0.01), (stop + 0.01) - s), 0.0, stop - start)
    np.testing.assert_allclose(found, wanted, atol=2.2e-3 * rate)


def test_a_turn_that_obeys_the_limit_is_left_as_it_is() -> None:
    s = np.linspace(0.0, 0.1, 101)
    z = leaning(5.0 * s)
    most = float(turn(z).max() / 1e-3)
    assert limited(s, z, 1.0001 * most) is z
    assert limited(s, z, 1.0001 * most, 0.005) is z
    assert limited(s, z, 0.9 * most) is not z


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_exact_reversal_becomes_half_a_turn_at_the_limits_rate(axis: int, sign: float) -> None:
    """Opposite directions have no shortest way between them: half a turn by the first axis that is square to them."""
    rate, at = 40.0, 0.1
    s = uneven(0.0, 0.2, 5)
    a, aside = sign * np.eye(3)[axis], np.eye(3)[0 if axis else 1]
    found = limited(s, np.where(s[:, None] < at, a, -a), rate)
    half = np.pi / (2 * rate)
    wanted = np.pi * np.clip((s - (at - half)) / (2 * half), 0.0, 1.0)
    np.testing.assert_allclose(np.arctan2(found @ aside, found @ a) % (2 * np.pi), wanted, atol=1.1e-3 * rate)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-12)
    assert (turn(found) <= rate * np.diff(s) + 1e-9).all()


def test_a_reversal_of_a_slanting_direction_leads_by_the_axis_nearest_to_square() -> None:
    """(2, 3, 6) / 7 is most square to x: what is left of x beside it is (45, -6, -12) / 49, of length sqrt(45) / 7."""
    a = np.array([2.0, 3.0, 6.0]) / 7
    found = limited(np.linspace(0.0, 0.2, 201), np.where(np.arange(201)[:, None] < 100, a, -a), 40.0)
    middle = found[np.abs(found @ a).argmin()]  # a step turns by 0.04 rad: within half of that of square
    np.testing.assert_allclose(middle - (middle @ a) * a, np.array([45.0, -6.0, -12.0]) / (7 * np.sqrt(45)), atol=0.02**2)


def test_opposite_directions_at_one_place_and_near_opposite_ones_stay_directions() -> None:
    s = np.array([0.0, 0.001, 0.001, 0.002])
    z = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(np.linalg.norm(limited(s, z, 100.0), axis=1), 1.0, atol=1e-12)
    for off in (1e-15, 1e-12, 1e-9, 1e-6):
        near = unit(z + np.array([0.0, off, 0.0]) * (z[:, 2:] < 0))
        found = limited(np.linspace(0.0, 0.003, 4), near, 100.0)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-9)


@pytest.mark.parametrize("length", [0.004, 0.01])
def test_a_plane_of_directions_is_smoothed_to_itself_to_the_ends(length: float) -> None:
    """A local line has no bias for what is linear in arc length, however uneven the samples."""
    s = uneven(0.0, 0.1, 1)
    line = np.stack([3 * s, 0.2 - 2 * s, -np.ones_like(s)], axis=1)
    np.testing.assert_allclose(smooth(s, line, length), unit(line), atol=1e-12)


def test_smoothing_is_a_gaussian_average_inside() -> None:
    """A cosine of small amplitude a and wave number k is damped to a exp(-(k length)^2 / 2)."""
    s, k, length = np.linspace(0.0, 0.2, 2001), 2 * np.pi / 0.02, 0.003
    found = smooth(s, unit(np.stack([1e-3 * np.cos(k * s), 0 * s, -np.ones_like(s)], axis=1)), length)
    inside = (s > 0.05) & (s < 0.15)
    wanted = 1e-3 * np.exp(-((k * length) ** 2) / 2) * np.cos(k * s)
    np.testing.assert_allclose(found[inside, 0], wanted[inside], atol=3e-6)


def test_three_directions_are_smoothed_and_two_are_not() -> None:
    s = np.array([0.0, 0.001, 0.002])
    z = unit(np.array([[0.0, 0.0, -1.0], [0.3, 0.0, -1.0], [0.0, 0.0, -1.0]]))
    assert 0.0 < smooth(s, z, 0.01)[1, 0] < 0.2
    np.testing.assert_array_equal(smooth(s[:2], 2 * z[:2], 0.01), unit(2 * z[:2]))
    np.testing.assert_array_equal(smooth(s, 2 * z, 0.0), unit(2 * z))


def test_samples_farther_apart_than_the_smoothing_stay() -> None:
    s = np.array([0.0, 0.1, 0.2, 0.3])
    z = leaning(np.array([0.0, 0.4, -0.2, 0.1]))
    np.testing.assert_allclose(smooth(s, z, 0.001), z, atol=1e-12)


@pytest.mark.parametrize("kept", [True, False])
def test_a_flip_is_taken_back_and_a_right_angle_is_none(kept: bool) -> None:
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    given = np.array([x, y, x, -x if not kept else x, -x if not kept else x])
    found = one_sided(given)
    np.testing.assert_array_equal(found, [x, y, x, x, x])
    np.testing.assert_allclose(one_sided(2 * given), 2 * found)


def test_of_as_many_on_either_side_the_first_is_kept() -> None:
    z = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    np.testing.assert_array_equal(one_sided(z), z[[0, 0]])
    np.testing.assert_array_equal(one_sided(-z), -z[[0, 0]])
