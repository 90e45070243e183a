"""The pieces of motion planning: kinematic model, Jacobian, rail, air moves, collision, config."""

import mink
import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.errors import ConfigError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import inverse_near, torch_pose
from weldsim.motion.arm import TORCH_SITE, jacobian, kinematic_model
from weldsim.motion.collision import CellCollision
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import make_rail
from weldsim.motion.rungs import roll_frames
from weldsim.motion.timing import air_move
from weldsim.mounts import X_FT
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import build_world


@pytest.mark.parametrize("seed", range(5))
def test_model_of_mink_is_the_arm(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-6, 6, 6)
    configuration = mink.Configuration(kinematic_model(), q=q)
    reached = configuration.get_transform_frame_to_world(TORCH_SITE, "site").as_matrix()
    assert np.abs(reached - torch_pose(q).matrix).max() < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_jacobian_is_the_derivative(seed: int) -> None:
    q = np.random.default_rng(seed).uniform(-3, 3, 6)
    h, J = 1e-6, jacobian(q[None])[0]
    for joint in range(6):
        step = h * np.eye(6)[joint]
        ahead, behind = torch_pose(q + step), torch_pose(q - step)
        assert np.abs((ahead.p - behind.p) / (2 * h) - J[:3, joint]).max() < 1e-8
        spin = (ahead.R - behind.R) / (2 * h) @ torch_pose(q).R.T
        assert np.abs(np.array([spin[2, 1], spin[0, 2], spin[1, 0]]) - J[3:, joint]).max() < 1e-8


def test_rail_leads_run_along_the_wire_and_keep_the_path() -> None:
    R = matrix_from_rotation_vector(np.array([0.3, -0.2, 1.0]))
    points = flat_curve("arc", 0.2) @ R.T + [0.0, -0.45, 0.1]
    path = torch_path(points, -R[:, 2])
    rail = make_rail(path, MotionConfig(approach=0.04))
    assert np.isclose(rail.s[0], -0.04)
    assert np.isclose(rail.s[-1], path.s[-1] + 0.04)
    assert np.allclose(rail.at(np.array([-0.04])).p[0], points[0] + 0.04 * R[:, 2])
    at = rail.at(path.s)
    assert np.abs(at.p - points).max() < 1e-9
    assert np.abs(at.R - path.X_BT.R).max() < 1e-7
    assert [rail.path_index(s) for s in (-0.03, 0.0, path.s[7], path.s[-1], path.s[-1] + 0.03)] == [
        0,
        0,
        7,
        len(points) - 1,
        len(points) - 1,
    ]


def test_roll_frames_keep_the_wire_and_do_not_spin() -> None:
    angle = np.linspace(0, 2 * np.pi, 60)
    circle = np.stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), 0 * angle], axis=1)
    frames = roll_frames(torch_path(circle, np.array([0.0, 0.0, -1.0])).X_BT)
    assert np.allclose(frames, frames[0])


@pytest.mark.parametrize("seed", range(20))
def test_air_move_is_straight_within_limits_and_at_rest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    config = MotionConfig()
    q0, q1 = rng.uniform(-3, 3, (2, 6)) if seed else np.stack([START, START])
    move = air_move(q0, q1, 0.1, config)
    assert np.allclose(move.q[0], q0, atol=1e-12)
    assert np.allclose(move.q[-1], q1, atol=1e-9)
    assert np.abs(move.qd[[0, -1]]).max() < 1e-9
    assert np.abs(move.qd).max() <= config.joint_speed + 1e-9
    assert np.abs(move.qdd).max() <= config.joint_acceleration + 1e-9
    assert np.abs(np.diff(move.qdd, axis=0, prepend=0.0)).max() <= config.joint_jerk * config.period + 1e-6
    span = np.abs(q1 - q0).max()
    if span > 0:
        share = (move.q - q0) @ (q1 - q0) / ((q1 - q0) @ (q1 - q0))
        assert np.abs(move.q - (q0 + share[:, None] * (q1 - q0))).max() < 1e-9
        assert (np.diff(share) >= -1e-12).all()


def test_collision_names_what_the_torch_hits() -> None:
    world = build_world(SceneConfig())
    collision = CellCollision(world.model)
    clear = world.view_joints()
    assert collision(clear) is None
    down = world.X_BP @ Transform("PT", np.diag([1.0, -1.0, -1.0]), np.array([0.03, 0.03, -0.03]))
    hit = inverse_near(down @ X_FT.inverse(), clear)
    touch = collision(hit)
    assert touch is not None
    assert "touches" in touch
    assert "part" in touch


@pytest.mark.parametrize(("key", "value"), [("period", 0.0), ("approach", -0.01), ("joint_speed", -1.0), ("rolls", 0)])
def test_config_refuses_nonsense(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"motion.{key}"):
        MotionConfig(**{key: value})
