"""Poses of the controller, beside the frames everything else uses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from weldsim.controller.kinematics import Kinematics
from weldsim.frames import Transform
from weldsim.kinematics import torch_pose
from weldsim.mounts import X_FT
from weldsim.urscript.poses import inverse_matrix, matrix_of, pose_between, pose_of, turn_between

TURNS = [0.0, 1e-9, 1e-5, 1e-3, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-7, np.pi]


@pytest.mark.parametrize("angle", TURNS)
@pytest.mark.parametrize("seed", range(8))
def test_pose_and_matrix_are_inverse_of_each_other_and_agree_with_frames(angle, seed):
    random = np.random.default_rng(seed)
    axis = np.eye(3)[seed % 3] if seed < 6 else random.normal(size=3)
    pose = [*random.uniform(-1, 1, 3), *(axis / np.linalg.norm(axis) * angle * (1 if seed % 2 else -1))]
    matrix = matrix_of(pose)
    np.testing.assert_allclose(matrix[:3, :3], Rotation.from_rotvec(pose[3:]).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(matrix_of(pose_of(matrix)), matrix, atol=1e-9)
    X = Transform.from_matrix("BT", matrix)
    if angle < np.pi - 1e-6:
        np.testing.assert_allclose(pose_of(matrix), [*X.p, *X.rotation_vector], atol=1e-9)
    np.testing.assert_allclose(matrix @ inverse_matrix(matrix), np.eye(4), atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_forward_inverse_and_jacobian_agree_with_the_arm(seed):
    q = np.random.default_rng(seed).uniform(-2.5, 2.5, 6)
    arm = Kinematics()
    pose = arm.tcp_pose(q.tolist(), X_FT.matrix)
    X = torch_pose(q)
    np.testing.assert_allclose(matrix_of(pose), X.matrix, atol=1e-9)
    found = arm.pose_joints(pose, X_FT.matrix, (q + 0.01).tolist())
    assert found is not None
    np.testing.assert_allclose(arm.tcp_pose(found, X_FT.matrix)[:3], X.p, atol=1e-7)
    J, h = arm.jacobian(q.tolist(), X_FT.matrix), 1e-6
    for joint in range(6):
        moved = torch_pose(q + h * np.eye(6)[joint])
        turn = Rotation.from_matrix(moved.R @ X.R.T).as_rotvec()
        np.testing.assert_allclose(J[:, joint], [*(moved.p - X.p) / h, *turn / h], atol=1e-5)


def test_halfway_is_halfway():
    random = np.random.default_rng(1)
    for _ in range(20):
        a, b = random.uniform(-1, 1, (2, 6)).tolist()
        middle = pose_between(a, b, 0.5)
        np.testing.assert_allclose(middle[:3], (np.array(a[:3]) + b[:3]) / 2, atol=1e-12)
        assert turn_between(a, middle) == pytest.approx(turn_between(a, b) / 2)
        np.testing.assert_allclose(matrix_of(pose_between(a, b, 1.0)), matrix_of(b), atol=1e-9)
