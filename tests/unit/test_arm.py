"""Arms by their own DH figures: poses turn into joint angles and back, whatever the figures; the nominal arm is the closed form."""

import numpy as np
import pytest

from tests.calibrations import ADDED, PUBLISHED, calibrated
from weldsim import kinematics
from weldsim.arm import UR5, Arm
from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import DH, STRAY, dh_frames, frames_jacobian, joints_at
from weldsim.motion.arm import dexterity
from weldsim.mounts import X_FT

ARMS = [PUBLISHED, ADDED, *(calibrated(size, seed).dh for size in (0.0003, 0.003, 0.015) for seed in range(3))]
AGILE = 0.05  # [m/rad] dexterity at which a posture is far from singular


def postures(seed: int, count: int = 1000) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (count, 6))


def _jacobian(dh: np.ndarray, q: np.ndarray) -> np.ndarray:
    frames = dh_frames(dh, q)
    return frames_jacobian(frames, frames[:, 6, :3, 3])


def test_the_nominal_arm_is_the_closed_form_to_the_bit() -> None:
    q, arm = postures(0), Arm(dh=DH.copy())
    assert arm.nominal
    assert UR5.deviation() < 1e-15
    assert (arm.torch_pose(q).p == kinematics.torch_pose(q).p).all()
    assert (arm.torch_tip(q) == kinematics.torch_tip(q)).all()
    X_BF = kinematics.flange_pose(q[:20])
    found, pose = arm.inverse_of_many(X_BF.matrix)
    wanted, same = kinematics.inverse_of_many(X_BF.matrix)
    assert (found == wanted).all()
    assert (pose == same).all()
    assert (arm.inverse_near(X_BF[3], q[3]) == kinematics.inverse_near(X_BF[3], q[3])).all()


@pytest.mark.parametrize("seed", range(len(ARMS)))
def test_joint_angles_put_the_arm_where_the_nominal_one_is(seed: int) -> None:
    dh, q = ARMS[seed], postures(seed)
    X_BF, agile = kinematics.flange_pose(q).matrix, dexterity(q) > AGILE
    own = joints_at(dh, X_BF, q)
    there = np.isfinite(own).all(axis=1)
    assert np.abs(dh_frames(dh, own[there])[:, 6] - X_BF[there]).max() < 1e-9
    assert np.abs(own - q)[there].max() <= STRAY
    assert there[agile].all()
    assert there.mean() > 0.8
    # Far from singularities a calibration changes the angles by no more than it moves the flange over the dexterity.
    assert np.abs(own - q)[agile].max() <= 4 * Arm(dh=dh).deviation() / AGILE


@pytest.mark.parametrize("seed", range(0, len(ARMS), 3))
def test_the_map_is_smooth(seed: int) -> None:
    dh, q, h = ARMS[seed], postures(100 + seed), 1e-5
    q = q[dexterity(q) > AGILE]
    step = h * np.random.default_rng(seed).uniform(-1.0, 1.0, q.shape)
    one, two = (joints_at(dh, kinematics.flange_pose(at).matrix, at) for at in (q, q + step))
    # Both arms' flanges move alike, so the step of one is that of the other through both Jacobians, to second order.
    twist = _jacobian(DH, q) @ step[..., None]
    np.testing.assert_allclose((two - one)[..., None], np.linalg.solve(_jacobian(dh, one), twist), atol=1e4 * h**2)


def test_what_cannot_be_reached_and_what_is_the_other_way_round_is_not_found() -> None:
    q = postures(1, 50)
    X_BF = kinematics.flange_pose(q).matrix
    far, back = X_BF.copy(), X_BF.copy()
    far[:, 0, 3] += 3.0
    back[:, :3, :2] *= -1.0  # half a turn about the flange's own axis
    for poses in (far, back):
        found = joints_at(PUBLISHED, poses, q)
        assert np.isnan(found).all()
    assert joints_at(PUBLISHED, X_BF[:0], q[:0]).shape == (0, 6)


@pytest.mark.parametrize("seed", range(len(ARMS)))
def test_every_branch_of_the_nominal_arm_is_one_of_this_arms(seed: int) -> None:
    arm, q = Arm(dh=ARMS[seed]), postures(seed, 60)
    X_BF = kinematics.flange_pose(q)
    found, pose = arm.inverse_of_many(X_BF.matrix)
    there = np.isfinite(found).all(axis=1)
    found, pose = found[there], pose[there]
    assert np.abs(arm.flange_pose(found).matrix - X_BF.matrix[pose]).max() < 1e-9
    assert np.abs(found).max() <= np.pi
    nominal, whose = kinematics.inverse_of_many(X_BF.matrix)
    wanted = np.bincount(whose[dexterity(nominal) > AGILE], minlength=len(q))
    assert (np.bincount(pose, minlength=len(q)) >= wanted).all()
    for i in np.flatnonzero(dexterity(q) > AGILE)[:10]:
        near = arm.inverse_near(X_BF[i], q[i])
        assert np.abs(near - q[i]).max() < STRAY
        assert len(arm.inverse(X_BF[i])) == (pose == i).sum()
        assert np.abs(arm.torch_pose(near).matrix - (X_BF[i] @ X_FT).matrix).max() < 1e-9
        assert np.abs(arm.torch_tip(near) - arm.torch_pose(near).p).max() < 1e-12


def test_a_pose_out_of_reach_is_an_error() -> None:
    with pytest.raises(UnreachableError):
        Arm(dh=PUBLISHED).inverse_near(Transform("BF", np.eye(3), np.array([2.0, 0.0, 0.0])), np.zeros(6))
