"""Transforms and rotations at their limits: what is refused and how it is told, what is stored, single poses and batches."""

import numpy as np
import pytest

from weldsim.errors import FrameError, RecordError
from weldsim.frames import (
    Transform,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    read_only,
    rotation_vector_from_matrix,
    slerp,
    unit,
    unit_quaternion,
)

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # about z
BATCH = Transform("BT", np.stack([np.eye(3), QUARTER]), np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))


def test_a_copy_that_cannot_be_written_lies_row_by_row() -> None:
    source = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    copy = read_only(source)
    source[0, 0] = 9.0
    assert copy[0, 0] == 0.0
    assert copy.flags.c_contiguous
    assert not copy.flags.writeable


def test_unit_vectors_are_along_the_last_axis_and_nothing_stays_nothing() -> None:
    found = unit(np.array([[[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]], [[0.0, -2.0, 0.0], [1e-100, 0.0, 0.0]]]))
    np.testing.assert_allclose(found, [[[0.6, 0.0, 0.8], [0.0, 0.0, 0.0]], [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]])
    np.testing.assert_allclose(unit_quaternion(np.array([[2.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0]])), [[1, 0, 0, 0], [0.5] * 4])


def built(names: str, R: np.ndarray, p: np.ndarray) -> Transform:
    """A transform checked by itself alone: the tests' own check of shapes would refuse some first."""
    made = object.__new__(Transform)
    for name, value in (("names", names), ("R", R), ("p", p)):
        object.__setattr__(made, name, value)
    made.__post_init__()
    return made


@pytest.mark.parametrize(
    ("R", "p"),
    [
        (np.eye(4), np.zeros(3)),
        (np.eye(3)[:2], np.zeros(3)),
        (np.eye(3), np.zeros((2, 3))),
        (np.tile(np.eye(3), (2, 1, 1)), np.zeros(3)),
        (np.eye(3), np.zeros(4)),
    ],
)
def test_shapes_that_disagree_are_refused(R: np.ndarray, p: np.ndarray) -> None:
    with pytest.raises(RecordError, match=r"^X_BT: rotation shape .* does not fit position shape"):
        built("BT", R, p)


def test_what_is_nearly_a_rotation_is_one_to_a_millionth() -> None:
    small = np.diag([1.0 + 0.4e-6, 1.0, 1.0])  # R R' is off by twice that
    assert Transform("BT", small, np.zeros(3)).R[0, 0] == 1.0 + 0.4e-6
    with pytest.raises(RecordError, match=r"^X_BT: not a rotation matrix \(off by 1\.2e-06\)$") as caught:
        Transform("BT", np.diag([1.0 + 0.6e-6, 1.0, 1.0]), np.zeros(3))
    assert caught.value.data["defect"] == pytest.approx(1.2e-6, rel=1e-3)
    with pytest.raises(RecordError, match="not a rotation"):
        Transform("BT", np.diag([1.0, 1.0, -1.0]), np.zeros(3))
    with pytest.raises(RecordError, match="not a rotation"):
        Transform("BT", np.stack([np.eye(3), np.diag([1.0, 1.0, -1.0])]), np.zeros((2, 3)))
    for R, p in ((np.full((3, 3), np.nan), np.zeros(3)), (np.eye(3), np.array([0.0, np.inf, 0.0]))):
        with pytest.raises(RecordError, match=r"^X_BT: holds a value that is not finite$"):
            Transform("BT", R, p)


def test_letters_are_told_when_they_are_wrong() -> None:
    with pytest.raises(FrameError, match=r"^frames 'BX': expected two of W, B, F, T, C, P, S$") as caught:
        Transform.identity("BX")
    assert caught.value.data == {"names": "BX"}
    with pytest.raises(FrameError, match=r"^X_BT @ X_FB: inner frames T and F differ$"):
        Transform.identity("BT") @ Transform.identity("FB")


def test_an_empty_batch_is_one() -> None:
    none = Transform("BT", np.zeros((0, 3, 3)), np.zeros((0, 3)))
    assert len(none) == 0
    assert none.batch == (0,)


def test_a_batch_has_a_length_and_members_a_single_one_has_none() -> None:
    assert len(BATCH) == 2
    assert BATCH.batch == (2,)
    assert BATCH[1].batch == ()
    assert BATCH[1].names == "BT"
    np.testing.assert_array_equal(BATCH[1].p, [4.0, 5.0, 6.0])
    np.testing.assert_array_equal(BATCH[::-1].p, BATCH.p[::-1])
    with pytest.raises(TypeError, match="a single Transform has no length"):
        len(BATCH[0])


def test_matrices_hold_rotation_position_and_one() -> None:
    found = BATCH.matrix
    np.testing.assert_array_equal(found[1], [[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]])
    again = Transform.from_matrix("BT", found)
    np.testing.assert_array_equal(again.R, BATCH.R)
    np.testing.assert_array_equal(again.p, BATCH.p)


def test_poses_by_quaternion_and_rotation_vector() -> None:
    half = np.sqrt(0.5)
    for X in (
        Transform.from_quaternion("FT", np.array([half, 0.0, 0.0, half]), np.array([1.0, 2.0, 3.0])),
        Transform.from_rotation_vector("FT", np.array([0.0, 0.0, np.pi / 2]), np.array([1.0, 2.0, 3.0])),
    ):
        assert X.names == "FT"
        np.testing.assert_allclose(X.R, QUARTER, atol=1e-15)
        np.testing.assert_array_equal(X.p, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(X.rotation_vector, [0.0, 0.0, np.pi / 2], atol=1e-15)
        np.testing.assert_allclose(X.vectors(np.eye(3)), QUARTER.T, atol=1e-15)


@pytest.mark.parametrize("q", [[0.0, 0.0, 0.0, 0.0], [0.0, 0.9e-12, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0], [np.inf, 0.0, 0.0, 1.0]])
def test_a_quaternion_without_length_or_number_is_refused(q: list[float]) -> None:
    for wxyz in (np.array(q), np.array([[1.0, 0.0, 0.0, 0.0], q])):
        with pytest.raises(RecordError, match=r"^quaternion: zero length or not finite$"):
            matrix_from_quaternion(wxyz)


def test_a_quaternion_may_be_short() -> None:
    np.testing.assert_allclose(matrix_from_quaternion(np.array([0.0, 1.1e-12, 0.0, 0.0])), np.diag([1.0, -1.0, -1.0]), atol=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_half_a_turn_about_each_axis(axis: int) -> None:
    """Where w is zero: the quaternion is the axis, the rotation vector pi times it."""
    R = -np.eye(3)
    R[axis, axis] = 1.0
    np.testing.assert_allclose(quaternion_from_matrix(R), [0.0, *np.eye(3)[axis]], atol=1e-15)
    np.testing.assert_allclose(np.abs(rotation_vector_from_matrix(R)), np.pi * np.eye(3)[axis], atol=1e-15)


def test_a_quaternion_has_double_precision_whatever_the_matrix_has() -> None:
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.float32)
    found = quaternion_from_matrix(R)
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, np.sqrt([0.5, 0.0, 0.0, 0.5]), atol=1e-15)


def test_no_turn_is_none() -> None:
    np.testing.assert_array_equal(quaternion_from_matrix(np.eye(3)), [1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(rotation_vector_from_matrix(np.eye(3)), np.zeros(3))
    np.testing.assert_array_equal(matrix_from_rotation_vector(np.zeros(3)), np.eye(3))
    tiny = matrix_from_rotation_vector(np.array([0.0, 1e-13, 0.0]))
    np.testing.assert_allclose(rotation_vector_from_matrix(tiny), [0.0, 1e-13, 0.0], atol=1e-17)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.4, 2.0, np.pi - 1e-3])
def test_slerp_is_a_turn_at_an_even_rate(angle: float, sign: float) -> None:
    """Either sign of a quaternion is the same turn; between nearly equal ones the way is straight."""
    q0, q1 = np.array([1.0, 0.0, 0.0, 0.0]), np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0])
    u = np.array([0.0, 0.25, 1.0])
    found = slerp(np.tile(q0, (3, 1)), np.tile(sign * q1, (3, 1)), u)
    wanted = np.stack([np.cos(u * angle / 2), np.sin(u * angle / 2), 0 * u, 0 * u], axis=1)
    np.testing.assert_allclose(found, wanted, atol=1e-15 + 1e-9 * angle)
