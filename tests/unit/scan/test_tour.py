"""The simulated arm driven from view to view: nothing touched, exposures where the joints report the camera to be."""

import numpy as np
import pytest

from weldsim.config import load_config, load_toml, structure
from weldsim.errors import MotionError
from weldsim.kinematics import flange_pose
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_FC
from weldsim.scan.tour import drive, way
from weldsim.scene.config import SceneConfig
from weldsim.scene.files import scene_path
from weldsim.scene.world import HOME, World, build_world

CONFIG = load_config()


def world_of(name: str) -> World:
    return build_world(structure({"name": name, **load_toml(scene_path(name))}, SceneConfig, where=name))


@pytest.mark.parametrize("name", ["straight", "cuboid"])
def test_exposures_are_where_the_arm_came_to_rest(name):
    world = world_of(name)
    tour = drive(world, CONFIG, CONFIG.motion, CONFIG.execution, sensor="exact")
    assert len(tour.captures) == len(tour.logs) == len(world.views)
    clear = CellCollision(world.model)
    for capture, log, asked in zip(tour.captures, tour.logs, world.views, strict=True):
        np.testing.assert_allclose(capture.frame.X_BC.matrix, (flange_pose(log.q_act[-1]) @ X_FC).matrix, atol=1e-12)
        away = np.linalg.norm(capture.frame.X_BC.p - asked.p)
        assert 0 < away < 0.3e-3  # servos sag; nothing was copied from the plan
        assert not [event.text for event in log.events if event.kind == "contact"]
        assert all(clear(q) is None for q in log.q_act[::10])
        assert not log.arc_on.any()
        assert np.abs(log.qd_act[-1]).max() < 1e-3
    for before, after in zip(tour.logs[:-1], tour.logs[1:], strict=True):
        np.testing.assert_allclose(after.q_act[0], before.q_act[-1], atol=1e-6)
    np.testing.assert_array_equal(tour.q, tour.logs[-1].q_act[-1])


def test_the_same_tour_gives_the_same_images():
    world = world_of("straight")
    one, two = (drive(world, CONFIG, CONFIG.motion, CONFIG.execution, seed=3).captures[0].frame.depth for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_a_view_without_a_way_is_refused_and_says_what_is_met():
    goal = HOME + np.array([1.0, 0, 0, 0, 0, 0])
    with pytest.raises(MotionError, match="scan view 3: the arm finds no way there: a wall"):
        way(HOME, goal, CONFIG.motion, lambda q: "a wall" if abs(q[0] - HOME[0] - 0.5) < 0.2 else None, 2)
