"""Interpolated poses: spacing, knots kept, straight chords, constant turning."""

import numpy as np
import pytest

from weldsim.errors import InputError
from weldsim.frames import Transform, rotation_vector_from_matrix
from weldsim.path.interpolate import STEP, interpolate_poses


def random_poses(seed: int, n: int = 12) -> Transform:
    rng = np.random.default_rng(seed)
    p = np.cumsum(rng.normal(0, 0.002, (n, 3)), axis=0)
    return Transform.from_rotation_vector("BT", rng.normal(0, 1.5, (n, 3)), p)


@pytest.mark.parametrize("seed", range(10))
def test_steps_are_even_and_no_longer_than_asked(seed: int) -> None:
    X = random_poses(seed)
    dense, s = interpolate_poses(X)
    step = np.linalg.norm(np.diff(dense.p, axis=0), axis=1)
    assert step.max() <= STEP * (1 + 1e-6)
    assert step.min() > STEP / 2
    np.testing.assert_allclose(np.diff(s), step, atol=1e-12)
    segment = np.clip(np.searchsorted(np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(X.p, axis=0), axis=1))]), s) - 1, 0, 10)
    off = np.cross(dense.p - X.p[segment], X.p[segment + 1] - X.p[segment])
    assert np.abs(off).max() < 1e-12  # on the chords


@pytest.mark.parametrize("seed", range(10))
def test_every_given_pose_is_kept(seed: int) -> None:
    X = random_poses(seed)
    dense, s = interpolate_poses(X)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(X.p, axis=0), axis=1))])
    at = np.searchsorted(s, length - 1e-12)
    np.testing.assert_allclose(dense.p[at], X.p, atol=1e-12)
    np.testing.assert_allclose(dense.R[at], X.R, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_the_torch_turns_at_a_constant_rate_the_short_way(seed: int) -> None:
    X = random_poses(seed, 2)
    dense, _ = interpolate_poses(X, 1e-4)
    turns = rotation_vector_from_matrix(np.swapaxes(dense.R[:-1], 1, 2) @ dense.R[1:])
    np.testing.assert_allclose(turns, np.broadcast_to(turns[0], turns.shape), atol=1e-7)
    whole = rotation_vector_from_matrix(X.R[0].T @ X.R[1])
    np.testing.assert_allclose(turns.sum(axis=0), whole, atol=1e-6)


def test_whole_steps_are_not_split() -> None:
    X = Transform("BT", np.broadcast_to(np.eye(3), (3, 3, 3)), np.array([[0.0, 0, 0], [0.003, 0, 0], [0.010, 0, 0]]))
    dense, s = interpolate_poses(X, 1e-3)
    assert len(dense) == 11
    np.testing.assert_allclose(s, np.arange(11) * 1e-3, atol=1e-15)


def test_one_pose_stays_one_and_nonsense_is_refused() -> None:
    X = random_poses(0)
    assert len(interpolate_poses(X[:1])[0]) == 1
    with pytest.raises(InputError, match="batch"):
        interpolate_poses(X[0])
    with pytest.raises(InputError, match="step"):
        interpolate_poses(X, 0.0)


def test_a_chord_shorter_than_a_step_gets_nothing_in_between() -> None:
    X = Transform("BT", np.broadcast_to(np.eye(3), (3, 3, 3)), np.array([[0.0, 0, 0], [0.0005, 0, 0], [0.0005, 0, 0]]))
    dense, s = interpolate_poses(X, 1e-3)
    np.testing.assert_array_equal(dense.p, X.p)
    np.testing.assert_allclose(s, [0.0, 0.0005, 0.0005])
    assert len(interpolate_poses(X, 4.9e-4)[1]) == 4


def test_what_is_refused_is_told_with_its_figure() -> None:
    X = random_poses(0)
    with pytest.raises(InputError, match=r"^interpolation: \(0,\) poses; a batch of at least one is needed$") as caught:
        interpolate_poses(X[:0])
    assert caught.value.data == {"batch": (0,)}
    with pytest.raises(InputError, match=r"^interpolation: step -0\.5 m must be positive$") as caught:
        interpolate_poses(X, -0.5)
    assert caught.value.data == {"step": -0.5}
    with pytest.raises(InputError, match="step nan"):
        interpolate_poses(X, float("nan"))
