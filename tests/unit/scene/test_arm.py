"""The MJCF arm is the arm of `weldsim.kinematics`, of ur-analytic-ik, and of a real UR5's log."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pytest
import ur_analytic_ik

from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import JOINT_NAMES, flange_pose, link_frames, torch_pose
from weldsim.mounts import X_FC
from weldsim.scene.config import SceneConfig
from weldsim.scene.files import asset_path
from weldsim.scene.shapes import TO_OPTICAL
from weldsim.scene.world import HOME, World, build_world

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1_link", "wrist_2_link", "wrist_3_link")


@pytest.fixture(scope="module")
def arm() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(asset_path("ur5", "ur5.xml")))


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(SceneConfig())


def configurations(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-2 * np.pi, 2 * np.pi, (n, 6))


def test_link_frames_are_those_of_the_kinematics(arm: mujoco.MjModel) -> None:
    data = mujoco.MjData(arm)
    for q in configurations(100):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm, data)
        for frame, name in zip(link_frames(q), LINKS, strict=True):
            body = data.body(name)
            assert np.abs(body.xpos - frame[:3, 3]).max() < 1e-9
            assert np.abs(body.xmat.reshape(3, 3) - frame[:3, :3]).max() < 1e-9


def test_flange_agrees_with_ur_analytic_ik(arm: mujoco.MjModel) -> None:
    data = mujoco.MjData(arm)
    for q in configurations(100, seed=1):
        data.qpos[:] = q
        mujoco.mj_kinematics(arm, data)
        theirs = np.asarray(ur_analytic_ik.ur5.forward_kinematics(*q))
        assert np.abs(data.site("flange").xpos - theirs[:3, 3]).max() < 1e-9
        assert np.abs(data.site("flange").xmat.reshape(3, 3) - theirs[:3, :3]).max() < 1e-9


def test_flange_agrees_with_a_real_arms_log(arm: mujoco.MjModel, real_data: Path) -> None:
    data = mujoco.MjData(arm)
    logs = sorted((real_data / "ur5_logs").glob("*.npz"))
    assert logs
    for path in logs:
        with np.load(path) as log:
            q, tool = log["q_actual"][::40, 1:], log["tool_vector"][::40, 1:]
        for row, pose in zip(q, tool, strict=True):
            data.qpos[:] = row
            mujoco.mj_kinematics(arm, data)
            assert np.linalg.norm(data.site("flange").xpos - pose[:3]) < 10e-6
            turn = matrix_from_rotation_vector(pose[3:]).T @ data.site("flange").xmat.reshape(3, 3)
            assert np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)) < 1e-4


def test_masses_limits_and_inertias(arm: mujoco.MjModel) -> None:
    masses = [arm.body(name).mass[0] for name in LINKS]
    assert masses == [3.7, 8.393, 2.33, 1.219, 1.219, 0.1879]
    assert arm.body_mass.sum() == pytest.approx(18.4, abs=1e-6)
    assert np.allclose(arm.jnt_range, [[-2 * np.pi, 2 * np.pi]] * 6)
    assert np.allclose(arm.jnt_actfrcrange[:, 1], [150, 150, 150, 28, 28, 28])
    assert np.allclose(arm.actuator_forcerange[:, 1], [150, 150, 150, 28, 28, 28])
    inertia = np.sort(arm.body_inertia[1:], axis=1)
    assert (inertia[:, 0] > 0).all()
    assert (inertia[:, 2] <= inertia[:, 0] + inertia[:, 1]).all()  # a real body's moments obey the triangle inequality


def test_torques_are_those_of_a_real_controller(arm: mujoco.MjModel, real_data: Path) -> None:
    """Inverse dynamics (mass, gravity, rotor inertia; no friction) against the target torques of a real UR5's controller."""
    model = mujoco.MjModel.from_xml_path(str(asset_path("ur5", "ur5.xml")))
    model.body_gravcomp[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_DAMPER) | int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    data, errors = mujoco.MjData(model), []
    for path in sorted((real_data / "ur5_logs").glob("*.npz")):
        with np.load(path) as log:
            rows = [log[name][::20, 1:] for name in ("q_target", "qd_target", "qdd_target", "m_target")]
        for q, qd, qdd, torque in zip(*rows, strict=True):
            data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
            mujoco.mj_inverse(model, data)
            errors.append(data.qfrc_inverse - torque)
    rms = np.sqrt(np.square(errors).mean(axis=0))
    assert (rms < [0.1, 0.5, 0.5, 0.01, 0.01, 0.01]).all(), rms


def test_tool_frames(world: World) -> None:
    data = mujoco.MjData(world.model)
    for q in configurations(20, seed=2):
        data.qpos[world.qpos] = q
        mujoco.mj_forward(world.model, data)
        torch, flange = world.site_pose(data), world.site_pose(data, "flange")
        assert np.abs(torch.matrix - torch_pose(q).matrix).max() < 1e-9
        assert np.abs(flange.matrix - flange_pose(q).matrix).max() < 1e-9
        cam = data.camera("d415")
        X_BC = world.X_WB.inverse() @ Transform("WC", cam.xmat.reshape(3, 3) @ TO_OPTICAL, cam.xpos)
        assert np.abs(X_BC.matrix - (flange_pose(q) @ X_FC).matrix).max() < 1e-9


def test_servos_hold_the_arm_and_the_tool_against_gravity(world: World) -> None:
    data = world.new_data(HOME)
    for _ in range(500):
        mujoco.mj_step(world.model, data)
    assert np.abs(data.qpos[world.qpos] - HOME).max() < 1e-3
    assert data.ncon == 0


def test_gravity_acts_when_the_servos_are_off(world: World) -> None:
    model = build_world(SceneConfig()).model
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    model.jnt_actgravcomp[:] = 0
    model.body_gravcomp[:] = 0.0
    data = mujoco.MjData(model)
    data.qpos[world.qpos] = HOME
    before = data.qpos.copy()
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - before).max() > 0.05


def outside(model: mujoco.MjModel, data: mujoco.MjData, geom: int, points: np.ndarray) -> np.ndarray:
    """Signed distance of points [m] from a capsule or cylinder."""
    local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
    radius, half = model.geom_size[geom, :2]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
        local[:, 2] -= np.clip(local[:, 2], -half, half)
        return np.linalg.norm(local, axis=1) - radius
    across, along = np.hypot(local[:, 0], local[:, 1]) - radius, np.abs(local[:, 2]) - half
    return np.minimum(np.maximum(across, along), 0) + np.hypot(np.maximum(across, 0), np.maximum(along, 0))


def test_collision_bodies_enclose_what_is_seen(arm: mujoco.MjModel) -> None:
    data = mujoco.MjData(arm)
    mujoco.mj_kinematics(arm, data)
    for geom in np.flatnonzero(arm.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        mesh = arm.geom_dataid[geom]
        vertices = arm.mesh_vert[arm.mesh_vertadr[mesh] :][: arm.mesh_vertnum[mesh]]
        points = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        same = np.flatnonzero((arm.geom_bodyid == arm.geom_bodyid[geom]) & (arm.geom_contype > 0))
        assert np.min([outside(arm, data, i, points) for i in same], axis=0).max() < 3.5e-3


def test_joint_names_are_shared(world: World) -> None:
    for i, name in enumerate(JOINT_NAMES):
        assert world.model.joint(name).qposadr[0] == world.qpos[i]
        assert world.model.actuator(world.actuators[i]).name == name


def test_committed_meshes_are_what_the_script_writes(tmp_path: Path) -> None:
    source = asset_path("ur5", "make_meshes.py")
    spec = importlib.util.spec_from_file_location("make_meshes", source)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.main(tmp_path)
    committed = sorted((source.parent / "meshes").glob("*.obj"))
    assert [path.name for path in committed] == sorted(path.name for path in tmp_path.glob("*"))
    for path in committed:
        ours = np.array([line.split()[1:] for line in (tmp_path / path.name).read_text().splitlines() if line[:2] == "v "], float)
        theirs = np.array([line.split()[1:] for line in path.read_text().splitlines() if line[:2] == "v "], float)
        assert np.abs(ours - theirs).max() < 2e-5
