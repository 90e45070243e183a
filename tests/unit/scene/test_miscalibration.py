"""A cell that differs from what its software believes: by as much as asked, in the camera's and the arm's place alone."""

import numpy as np
import pytest

from weldsim.config import CellConfig, load_config
from weldsim.errors import ConfigError
from weldsim.frames import Transform
from weldsim.kinematics import flange_pose
from weldsim.mounts import X_FC
from weldsim.pipeline import scan
from weldsim.scene.config import SceneConfig
from weldsim.scene.miscalibration import TwinConfig
from weldsim.scene.world import World, build_world
from weldsim.sensor.base import View
from weldsim.sensor.exact import ExactSensor, twin_scene

SCENE = SceneConfig()


def between(A: Transform, B: Transform) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses."""
    R = A.R.T @ B.R
    sine = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    return float(np.linalg.norm(A.p - B.p)), float(np.arctan2(sine, (np.trace(R) - 1) / 2))


def flange(world: World, q: np.ndarray) -> Transform:
    return world.site_pose(world.new_data(q), "flange")


@pytest.mark.parametrize("seed", range(5))
def test_the_hand_eye_error_is_as_large_as_asked(seed):
    twin = TwinConfig(hand_eye_position=0.002, hand_eye_rotation=0.01, seed=seed)
    distance, angle = between(X_FC, twin.X_FC)
    assert distance == pytest.approx(0.002, rel=1e-9)
    assert angle == pytest.approx(0.01, rel=1e-9)
    other = TwinConfig(hand_eye_position=0.002, hand_eye_rotation=0.01, seed=seed + 1)
    assert between(twin.X_FC, other.X_FC)[0] > 1e-5


def test_a_perfect_cell_is_what_the_software_believes():
    world = build_world(SCENE)
    q = world.view_joints(0)
    assert TwinConfig().perfect
    assert max(between(flange(world, q), flange_pose(q))) < 1e-9
    assert world.camera_pose(0, world.new_data(q)) is world.views[0]


def test_a_hand_eye_error_leaves_the_arm_and_moves_the_camera():
    twin = TwinConfig(hand_eye_position=0.003, hand_eye_rotation=0.02)
    world = build_world(SCENE, twin=twin)
    q = world.view_joints(0)
    assert max(between(flange(world, q), flange_pose(q))) < 1e-9
    distance, angle = between(world.views[0], world.camera_pose(0, world.new_data(q)))
    assert distance == pytest.approx(0.003, rel=1e-6)
    assert angle == pytest.approx(0.02, rel=1e-6)


def test_a_kinematic_error_grows_in_proportion_and_is_of_the_size_of_its_parts():
    rng = np.random.default_rng(3)
    joints = rng.uniform(-2, 2, (6, 6))
    off = {}
    for scale in (1.0, 2.0):
        worlds = [
            build_world(SCENE, twin=TwinConfig(kinematic_position=scale * 1e-4, kinematic_rotation=scale * 2e-4, seed=seed))
            for seed in range(3)
        ]
        off[scale] = np.array([[flange(world, q).p - flange_pose(q).p for q in joints] for world in worlds])
    np.testing.assert_allclose(off[2.0], 2 * off[1.0], atol=2e-6)
    rms = float(np.sqrt((off[1.0] ** 2).sum(axis=-1).mean()))
    # Six joints of 0.1 mm a coordinate give 0.42 mm; 0.2 mrad at up to 0.85 m from the flange add up to as much again.
    assert 0.2e-3 < rms < 1.5e-3


@pytest.mark.render
def test_frames_say_where_the_camera_was_meant_to_stand_and_show_what_it_saw():
    config = CellConfig(twin=TwinConfig(hand_eye_position=0.002, hand_eye_rotation=0.005, kinematic_rotation=2e-4))
    world = build_world(SCENE, twin=config.twin)
    (capture,) = scan(world, config, sensor="exact")
    assert capture.frame.X_BC is world.views[0]
    data = world.new_data(world.view_joints(0))
    camera = ExactSensor(twin_scene(world, data), world.intrinsics)
    try:
        there, meant = (camera.capture(View(X_BC=X)).frame.depth for X in (world.camera_pose(0, data), world.views[0]))
    finally:
        camera.close()
    np.testing.assert_array_equal(capture.frame.depth, there)
    assert np.nanmedian(np.abs(meant - there)) > 1e-4


def test_errors_are_written_with_units_and_nonsense_is_refused():
    config = load_config(overrides=["twin.hand_eye_position=1 mm", "twin.kinematic_rotation=0.02 deg", "twin.seed=4"])
    assert config.twin == TwinConfig(hand_eye_position=0.001, kinematic_rotation=np.deg2rad(0.02), seed=4)
    for text in ("hand_eye_position=-1 mm", "hand_eye_position=1 m", "kinematic_rotation=30 deg", "seed=-1", "hand_eye=1 mm"):
        with pytest.raises(ConfigError):
            load_config(overrides=[f"twin.{text}"])
