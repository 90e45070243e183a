"""Transforms are a group whose letters cancel; quaternions and rotation vectors are two more ways to write them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from weldsim.errors import FrameError, RecordError
from weldsim.frames import (
    LETTERS,
    Transform,
    matrix_from_quaternion,
    matrix_from_rotation_vector,
    quaternion_from_matrix,
    rotation_vector_from_matrix,
    slerp,
)

# Angles where codecs break: nothing, almost nothing, half a turn and its neighbourhood.
angles = st.one_of(
    st.floats(0, np.pi),
    st.sampled_from([0.0, 1e-16, 1e-12, 1e-9, 1e-6, np.pi / 2, np.pi - 1e-6, np.pi - 1e-9, np.pi - 1e-12, np.pi]),
)
axes = st.one_of(
    arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 1e-3),
    st.sampled_from([np.eye(3)[i] * sign for i in range(3) for sign in (1.0, -1.0)]),
).map(lambda v: v / np.linalg.norm(v))
rotation_vectors = st.builds(lambda axis, angle: axis * angle, axes, angles)
positions = arrays(float, 3, elements=st.floats(-3, 3))


def transforms(names: str) -> st.SearchStrategy[Transform]:
    return st.builds(lambda v, p: Transform.from_rotation_vector(names, v, p), rotation_vectors, positions)


def close(left: Transform, right: Transform, tolerance: float = 1e-12) -> None:
    assert left.names == right.names
    np.testing.assert_allclose(left.matrix, right.matrix, atol=tolerance)


@given(transforms("BF"), transforms("FT"), transforms("TC"))
def test_composition_is_associative(X_BF: Transform, X_FT: Transform, X_TC: Transform) -> None:
    close((X_BF @ X_FT) @ X_TC, X_BF @ (X_FT @ X_TC))


@given(transforms("BT"))
def test_identity_and_inverse(X_BT: Transform) -> None:
    close(Transform.identity("BB") @ X_BT, X_BT)
    close(X_BT @ Transform.identity("TT"), X_BT)
    close(X_BT @ X_BT.inverse(), Transform.identity("BB"))
    close(X_BT.inverse() @ X_BT, Transform.identity("TT"))
    close(X_BT.inverse().inverse(), X_BT)


@given(transforms("BF"), transforms("FT"))
def test_the_inverse_of_a_product_is_the_product_of_inverses_backwards(X_BF: Transform, X_FT: Transform) -> None:
    close((X_BF @ X_FT).inverse(), X_FT.inverse() @ X_BF.inverse())


@given(transforms("BF"), transforms("FT"), arrays(float, (4, 3), elements=st.floats(-2, 2)))
def test_composition_acts_on_points_one_after_the_other(X_BF: Transform, X_FT: Transform, points_T: np.ndarray) -> None:
    X_BT = X_BF @ X_FT
    np.testing.assert_allclose(X_BT.points(points_T), X_BF.points(X_FT.points(points_T)), atol=1e-12)
    lengths = np.linalg.norm(points_T[1:] - points_T[:-1], axis=1)
    moved = X_BT.points(points_T)
    np.testing.assert_allclose(np.linalg.norm(moved[1:] - moved[:-1], axis=1), lengths, atol=1e-12)
    np.testing.assert_allclose(X_BT.vectors(points_T[1:] - points_T[:-1]), moved[1:] - moved[:-1], atol=1e-12)


@given(st.text(sorted(LETTERS), min_size=2, max_size=2), st.text(sorted(LETTERS), min_size=2, max_size=2))
def test_letters_cancel_or_it_is_an_error(left: str, right: str) -> None:
    X, Y = Transform.identity(left), Transform.identity(right)
    if left[1] == right[0]:
        assert (X @ Y).names == left[0] + right[1]
    else:
        with pytest.raises(FrameError, match=f"X_{left} @ X_{right}") as caught:
            X @ Y
        assert caught.value.data == {"left": left, "right": right}


@pytest.mark.parametrize("names", ["", "B", "BTC", "BX", "bt"])
def test_unknown_letters_are_refused(names: str) -> None:
    with pytest.raises(FrameError):
        Transform.identity(names)


@settings(max_examples=300)
@given(rotation_vectors)
def test_rotation_vectors_round_trip_and_agree_with_scipy(vector: np.ndarray) -> None:
    R = matrix_from_rotation_vector(vector)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)
    back = rotation_vector_from_matrix(R)
    assert np.linalg.norm(back) <= np.pi + 1e-12
    np.testing.assert_allclose(matrix_from_rotation_vector(back), R, atol=1e-14)
    if np.linalg.norm(vector) < np.pi - 1e-7:  # at half a turn both signs of the axis mean the same
        np.testing.assert_allclose(back, vector, atol=1e-7 if np.linalg.norm(vector) > 3 else 1e-14)


@settings(max_examples=300)
@given(rotation_vectors)
def test_quaternions_round_trip_for_every_angle(vector: np.ndarray) -> None:
    R = matrix_from_rotation_vector(vector)
    q = quaternion_from_matrix(R)
    assert q[0] >= 0
    assert abs(np.linalg.norm(q) - 1) < 1e-14
    np.testing.assert_allclose(matrix_from_quaternion(q), R, atol=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(-2.5 * q), R, atol=1e-14)


@given(st.lists(st.tuples(rotation_vectors, positions), min_size=1, max_size=6))
def test_a_batch_is_its_members(members: list[tuple[np.ndarray, np.ndarray]]) -> None:
    vectors, p = np.array([v for v, _ in members]), np.array([p for _, p in members])
    X_BT, X_TF = Transform.from_rotation_vector("BT", vectors, p), Transform.from_rotation_vector("TF", vectors[0], p[0])
    assert len(X_BT) == len(members)
    for i in range(len(members)):
        single = Transform.from_rotation_vector("BT", vectors[i], p[i])
        close(X_BT[i], single)
        close((X_BT @ X_TF)[i], single @ X_TF)
        close(X_BT.inverse()[i], single.inverse())
        np.testing.assert_allclose(X_BT.quaternion[i], single.quaternion, atol=1e-12)


@given(rotation_vectors, rotation_vectors)
def test_slerp_meets_its_ends_and_turns_evenly_the_short_way(v0: np.ndarray, v1: np.ndarray) -> None:
    q0 = quaternion_from_matrix(matrix_from_rotation_vector(v0))
    q1 = quaternion_from_matrix(matrix_from_rotation_vector(v1))
    R0, R1 = matrix_from_quaternion(q0), matrix_from_quaternion(q1)
    u = np.linspace(0, 1, 9)
    q = slerp(np.tile(q0, (9, 1)), np.tile(q1, (9, 1)), u)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(q[0]), R0, atol=1e-9)
    np.testing.assert_allclose(matrix_from_quaternion(q[-1]), R1, atol=1e-9)
    total = np.linalg.norm(rotation_vector_from_matrix(R0.T @ R1))
    turned = [np.linalg.norm(rotation_vector_from_matrix(R0.T @ R)) for R in matrix_from_quaternion(q)]
    np.testing.assert_allclose(turned, u * total, atol=1e-6)


@given(transforms("BT"), st.integers(0, 2), st.floats(1e-4, 1))
def test_what_is_no_rotation_is_refused(X_BT: Transform, row: int, error: float) -> None:
    R = X_BT.R.copy()
    R[row] *= 1 + error
    with pytest.raises(RecordError, match="not a rotation"):
        Transform("BT", R, X_BT.p)
    with pytest.raises(RecordError, match="not a rotation"):
        Transform("BT", -X_BT.R, X_BT.p)
    with pytest.raises(RecordError, match="not finite"):
        Transform("BT", X_BT.R, X_BT.p + np.nan)


def test_arrays_cannot_be_written_and_do_not_follow_their_source() -> None:
    p = np.zeros(3)
    X_BT = Transform("BT", np.eye(3), p)
    p[0] = 1
    assert X_BT.p[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        X_BT.p[0] = 1
