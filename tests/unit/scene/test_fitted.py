"""The twin with a calibrated arm in it: flange and tip where that arm has them, links where its axes are, the rest as it was."""

import mujoco
import numpy as np
import pytest

from tests.arm_worlds import bare_model
from tests.calibrations import ADDED, PUBLISHED, calibrated
from weldsim.arm import UR5, Arm
from weldsim.kinematics import DH, JOINT_NAMES
from weldsim.motion.arm import TORCH_SITE, kinematic_model
from weldsim.scene.fitted import fitted_model

ARMS = [PUBLISHED, ADDED, calibrated(0.003, 1).dh, calibrated(0.015, 2).dh]


def posed(model: mujoco.MjModel, q: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[[model.joint(name).qposadr[0] for name in JOINT_NAMES]] = q
    mujoco.mj_kinematics(model, data)
    return data


def in_base(model: mujoco.MjModel, data: mujoco.MjData, points: np.ndarray) -> np.ndarray:
    base = model.body("ur5_base").id
    return (points - data.xpos[base]) @ data.xmat[base].reshape(3, 3)


@pytest.mark.parametrize("which", range(len(ARMS)))
def test_tip_and_links_are_where_the_arm_has_them(which: int) -> None:
    arm, nominal = Arm(dh=ARMS[which]), bare_model()
    before = nominal.body_pos.copy(), nominal.jnt_axis.copy()
    model, size = fitted_model(nominal, arm), arm.deviation()
    assert (nominal.body_pos == before[0]).all()
    assert (nominal.jnt_axis == before[1]).all()
    rng = np.random.default_rng(which)
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        data, plain = posed(model, q), posed(nominal, q)
        np.testing.assert_allclose(in_base(model, data, data.site("torch_tip").xpos), arm.torch_tip(q), atol=1e-11)
        links = [model.body(name).id for name in ("shoulder", "upper_arm", "forearm", "wrist_1_link", "wrist_2_link")]
        moved = np.linalg.norm(data.xpos[links] - plain.xpos[links], axis=1)
        assert moved.max() < 2 * size  # no link is further off than flanges of the two arms can be
        assert moved.max() > 1e-5
        # The axis of each joint is the one about which the arm really turns: a step of one joint moves the tip as it should.
        step = 0.3 * np.eye(6)[rng.integers(6)]
        after = posed(model, q + step)
        np.testing.assert_allclose(in_base(model, after, after.site("torch_tip").xpos), arm.torch_tip(q + step), atol=1e-11)


def test_the_nominal_arm_stays_where_it_is() -> None:
    model, q = bare_model(), np.array([0.3, -1.2, 1.5, -0.4, 1.1, 2.0])
    same = fitted_model(model, Arm(dh=DH))
    np.testing.assert_allclose(posed(same, q).geom_xpos, posed(model, q).geom_xpos, atol=1e-12)


@pytest.mark.parametrize("which", range(len(ARMS)))
def test_the_model_for_differential_kinematics_is_the_arm(which: int) -> None:
    for arm in (Arm(dh=ARMS[which]), UR5):
        model = kinematic_model(arm)
        for q in np.random.default_rng(which).uniform(-np.pi, np.pi, (20, 6)):
            site = posed(model, q).site(TORCH_SITE)
            np.testing.assert_allclose(site.xpos, arm.torch_tip(q), atol=1e-11)
            np.testing.assert_allclose(site.xmat.reshape(3, 3), arm.torch_pose(q).R, atol=1e-11)
