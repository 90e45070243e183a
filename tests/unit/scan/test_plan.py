"""Views chosen from a part's geometry: they see what they must, the arm takes them, and what cannot be seen is refused."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.config import load_toml, structure
from weldsim.errors import UnreachableError
from weldsim.kinematics import flange_pose
from weldsim.motion.collision import CellCollision
from weldsim.mounts import X_FC
from weldsim.scan.config import ScanConfig
from weldsim.scan.plan import groove_places, plan_views
from weldsim.scan.sight import make_sight
from weldsim.scene.config import SceneConfig
from weldsim.scene.files import scene_path
from weldsim.scene.world import World, build_world

CONFIG = ScanConfig()


def world_of(name: str, **pose: float) -> World:
    scene = structure({"name": name, **load_toml(scene_path(name))}, SceneConfig, where=name)
    return build_world(replace(scene, pose=replace(scene.pose, **pose)))


@pytest.mark.parametrize(("name", "most"), [("straight", 1), ("curve", 2), ("cuboid", 7)])
def test_chosen_views_see_the_groove_and_can_be_taken(name, most):
    world = world_of(name)
    plan = plan_views(world, CONFIG)
    assert 1 <= len(plan.views) <= most
    assert plan.covered >= CONFIG.coverage
    seen, clear = np.zeros(len(plan.places), bool), CellCollision(world.model)
    for X_BC, q in zip(plan.views, plan.joints, strict=True):
        np.testing.assert_allclose((flange_pose(q) @ X_FC).matrix, X_BC.matrix, atol=1e-6)
        assert clear(q) is None
        now = make_sight(world).sees(X_BC, plan.places, plan.normals, CONFIG)
        towards = X_BC.p - plan.places[now]
        steep = np.einsum("ij,ij->i", towards, plan.normals[now]) / np.linalg.norm(towards, axis=1)
        assert (steep > np.cos(CONFIG.incidence)).all()
        seen |= now
    assert seen.mean() == pytest.approx(plan.covered)


def test_places_lie_about_the_groove_on_each_face_that_has_it():
    world = world_of("cuboid")
    places, normals = groove_places(world, CONFIG.surroundings)
    line = world.known_seams[0].opening_B
    for direction in ([0, 0, 1], [1, 0, 0], [-1, 0, 0]):
        on = normals @ np.array(direction, float) > 0.99
        assert on.sum() > 100
        assert max(np.linalg.norm(line - place, axis=1).min() for place in places[on][::10]) < 0.045


def test_the_same_part_gets_the_same_views():
    world = world_of("curve")
    for one, two in zip(plan_views(world).views, plan_views(world).views, strict=True):
        np.testing.assert_array_equal(one.matrix, two.matrix)


def test_what_the_arm_cannot_reach_is_refused():
    with pytest.raises(UnreachableError, match=r"cannot be seen, most of it on the part's \+z side .* out of the arm's reach"):
        plan_views(world_of("straight", x=0.45, y=-0.6, clearance=0.7))


def test_a_range_in_which_nothing_is_seen_is_refused():
    with pytest.raises(UnreachableError, match="no camera pose in range sees it unobstructed"):
        plan_views(world_of("straight"), ScanConfig(nearest=0.05, farthest=0.06))
