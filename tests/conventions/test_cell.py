"""Base, flange and torch: where the frames of the cell are, held against the twin and against what a real robot said."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from weldsim import mounts
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES, SPEED_LIMIT, flange_pose, link_frames, torch_pose

HALF_TURN_ABOUT_Z = np.diag([-1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def world():
    from weldsim.scene.config import SceneConfig
    from weldsim.scene.world import build_world

    return build_world(SceneConfig())


def test_world_has_z_up_and_the_base_is_turned_half_a_turn_in_it():
    np.testing.assert_array_equal(mounts.X_WB.R, HALF_TURN_ABOUT_Z)
    assert mounts.X_WB.p[2] > 0  # the floor is below the table top


def test_gravity_points_down_in_the_world(world):
    np.testing.assert_allclose(world.model.opt.gravity[:2], 0)
    assert world.model.opt.gravity[2] < -9


def test_overhead_camera_looks_down():
    np.testing.assert_allclose(mounts.X_WC_KINECT.R[:, 2], [0, 0, -1])
    X_BC = mounts.X_WB.inverse() @ mounts.X_WC_KINECT
    # published as base_link to camera: t = (-0.041, 0.444, 0.830); base_link is the base turned half a turn
    np.testing.assert_allclose(HALF_TURN_ABOUT_Z @ X_BC.p, [-0.041, 0.444, 0.830], atol=1e-12)


def test_torch_is_bolted_to_the_flange_as_published():
    np.testing.assert_allclose(mounts.X_FT.p, [0, 0.048, 0.227])
    np.testing.assert_allclose(np.rad2deg(mounts.X_FT.rotation_vector), [-48.70, 0, 0])
    np.testing.assert_allclose(torch_pose(np.zeros(6)).matrix, (flange_pose(np.zeros(6)) @ mounts.X_FT).matrix)


def test_wrist_camera_is_bolted_to_the_flange_as_published():
    np.testing.assert_array_equal(mounts.X_FC.R, np.eye(3))
    np.testing.assert_allclose(mounts.X_FC.p, [-0.0356, -0.1161, 0.0739])


def test_joints_are_named_in_order_from_the_base():
    assert JOINT_NAMES == ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    q = np.random.default_rng(0).uniform(-3, 3, 6)
    for joint in range(6):  # a joint moves its own link and those after it
        moved = q.copy()
        moved[joint] += 0.1
        change = np.abs(link_frames(moved) - link_frames(q)).max(axis=(1, 2))
        assert (change[:joint] == 0).all()
        assert (change[joint:] > 1e-3).all()


def test_joint_limits_are_a_whole_turn_and_180_degrees_a_second(world):
    assert np.rad2deg(JOINT_LIMIT) == pytest.approx(360)
    assert np.rad2deg(SPEED_LIMIT) == pytest.approx(180)
    joints = [world.model.joint(name).range for name in JOINT_NAMES]
    np.testing.assert_allclose(joints, [[-JOINT_LIMIT, JOINT_LIMIT]] * 6, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_the_twin_moves_flange_and_torch_as_the_formula_says(world, seed):
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, 6)
    data = world.new_data(q)
    np.testing.assert_allclose(world.site_pose(data, "flange").matrix, flange_pose(q).matrix, atol=1e-6)
    np.testing.assert_allclose(world.site_pose(data, "torch_tip").matrix, torch_pose(q).matrix, atol=1e-6)


def test_base_and_flange_are_the_controllers(real_data):
    """A real UR5 logged its joints and its tool0 pose (position, rotation vector): the same frames, to 10 um."""
    log = np.load(real_data / "ur5_logs" / "Movement_No1.npz")
    q, pose = log["q_actual"][::50, 1:], log["tool_vector"][::50, 1:]
    X_BF = flange_pose(q)
    assert np.linalg.norm(X_BF.p - pose[:, :3], axis=1).max() < 10e-6
    turned = Rotation.from_matrix(X_BF.R).inv() * Rotation.from_rotvec(pose[:, 3:])
    assert turned.magnitude().max() < 1e-4


def test_tip_poses_in_base_link_are_tool0_poses_times_the_torch_mount(real_data):
    """The thesis author's path exists both as tool0 in the controller's base and as torch tips in base_link."""
    paths = real_data / "thesis_paths"
    sent = np.loadtxt(paths / "ur_y_shape.csv", delimiter=",")
    tips = np.loadtxt(paths / "tip_y_shape.csv", delimiter=",")
    X_BT = Transform.from_rotation_vector("BF", sent[:, 3:], sent[:, :3]) @ mounts.X_FT
    half_turn = Transform("WB", HALF_TURN_ABOUT_Z, np.zeros(3))  # base_link has the world's orientation
    X_LT = half_turn @ X_BT
    assert np.linalg.norm(X_LT.p - tips[:, :3], axis=1).max() < 0.01e-3
    turned = Rotation.from_matrix(X_LT.R).inv() * Rotation.from_quat(tips[:, 3:])
    assert np.rad2deg(turned.magnitude().max()) < 0.01


def test_wire_points_down_into_the_work(real_data):
    """z of the torch runs along the wire towards the work, which lay on a table in the thesis's cell."""
    sent = np.loadtxt(real_data / "thesis_paths" / "ur_y_shape.csv", delimiter=",")
    X_BT = Transform.from_rotation_vector("BF", sent[:, 3:], sent[:, :3]) @ mounts.X_FT
    assert (X_BT.R[:, 2, 2] < -0.3).all()  # its seam slopes by 38 deg


@pytest.mark.parametrize("camera", ["d415", "kinect"])
def test_mujoco_cameras_are_optical_frames_turned_half_a_turn_about_x(world, camera):
    q = np.array([0.3, -1.6, -1.8, -1.2, 1.4, 0.2])
    data = world.new_data(q)
    X_BC = flange_pose(q) @ mounts.X_FC if camera == "d415" else mounts.X_WB.inverse() @ mounts.X_WC_KINECT
    X_WC = mounts.X_WB @ X_BC
    found = data.cam(camera)
    np.testing.assert_allclose(found.xpos, X_WC.p, atol=1e-6)
    np.testing.assert_allclose(found.xmat.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0]), X_WC.R, atol=1e-6)


def test_part_has_z_out_of_the_surface_and_x_along_travel(world):
    curve = world.workpiece.seam_curves()[0]
    travel = curve.opening[-1] - curve.opening[0]
    assert travel[0] > 0.9 * np.linalg.norm(travel)
    assert (curve.bisectors[:, 2] < -0.9).all()
    np.testing.assert_allclose(curve.opening[:, 2], 0, atol=1e-9)
    assert world.workpiece.build_mesh().vertices[:, 2].max() == pytest.approx(0, abs=1e-9)
