"""Quaternions are w x y z; rotation vectors are axis times angle."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from weldsim.frames import Transform, matrix_from_quaternion, matrix_from_rotation_vector

QUARTER_TURN_ABOUT_Z = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x goes to y


def test_rotations_are_right_handed():
    np.testing.assert_allclose(matrix_from_rotation_vector(np.array([0.0, 0.0, np.pi / 2])), QUARTER_TURN_ABOUT_Z, atol=1e-12)


def test_quaternions_are_wxyz():
    half = np.sqrt(0.5)
    np.testing.assert_allclose(matrix_from_quaternion(np.array([half, 0.0, 0.0, half])), QUARTER_TURN_ABOUT_Z, atol=1e-12)
    np.testing.assert_allclose(Transform("BT", QUARTER_TURN_ABOUT_Z, np.zeros(3)).quaternion, [half, 0, 0, half], atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_that_come_out_have_w_not_negative(seed):
    R = Rotation.random(200, random_state=seed).as_matrix()
    wxyz = Transform("BT", R, np.zeros((200, 3))).quaternion
    xyzw = Rotation.from_matrix(R).as_quat(canonical=True)
    assert (wxyz[:, 0] >= 0).all()
    np.testing.assert_allclose(wxyz, np.roll(xyzw, 1, axis=1), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_rotation_vectors_are_axis_times_angle_up_to_half_a_turn(seed):
    R = Rotation.random(200, random_state=seed).as_matrix()
    vectors = Transform("BT", R, np.zeros((200, 3))).rotation_vector
    assert np.linalg.norm(vectors, axis=1).max() <= np.pi + 1e-12
    np.testing.assert_allclose(vectors, Rotation.from_matrix(R).as_rotvec(), atol=1e-9)
