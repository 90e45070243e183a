"""A weld over two edges of a box, which no constant rotation about the wire can sweep, is planned and touches nothing."""

import numpy as np
import pytest

from weldsim.config import load_scene
from weldsim.curves import arc_length, interpolate, tangents
from weldsim.errors import MotionError
from weldsim.frames import unit
from weldsim.kinematics import torch_pose
from weldsim.motion.collision import CellCollision
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import plan_motion
from weldsim.motion.posture import find_postures
from weldsim.motion.rail import make_rail
from weldsim.mounts import X_FT
from weldsim.path.config import PathConfig
from weldsim.path.plan import plan_path
from weldsim.records import KnownSeam, Seam, TorchPath
from weldsim.scene.world import World, build_world

ROUNDED = 0.008  # [m] to either side, over which the seam's corners are averaged


def path_along(known: KnownSeam) -> TorchPath:
    s = np.linspace(0, known.length, int(known.length / 0.002))
    window = np.linspace(-ROUNDED, ROUNDED, 9)

    def averaged(values: np.ndarray) -> np.ndarray:
        return np.mean([interpolate(known.s, values, np.clip(s + d, 0, known.length)) for d in window], axis=0)

    points = averaged(known.opening_B)
    along, out = tangents(points), averaged(-known.bisectors_B)
    out = unit(out - np.einsum("ij,ij->i", out, along)[:, None] * along)
    return plan_path(Seam(points_B=points, s=arc_length(points), tangents_B=along, normals_B=out), PathConfig())


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(load_scene("cuboid"))


def test_the_cuboid_is_welded_over_its_three_faces(world: World) -> None:
    path, blocked, config = path_along(world.known_seams[0]), CellCollision(world.model), MotionConfig()
    q_start = world.view_joints(len(world.views) - 1)
    with pytest.raises(MotionError, match="touch"):  # with one rotation about the wire
        find_postures(make_rail(path, config), q_start, X_FT, config, blocked)
    plan = plan_motion(path, q_start, config, blocked=blocked)
    assert plan.position_error < 0.1e-3
    assert plan.axis_error < np.deg2rad(0.1)
    assert all(blocked(q) is None for q in plan.trajectory.q[::25])
    welding = plan.trajectory.arc_on
    tip = torch_pose(plan.trajectory.q[welding]).p
    assert np.abs(plan.rail.at(plan.trajectory.s[welding]).p - tip).max() < 0.1e-3
    assert np.ptp(tip[:, 2]) > 0.31  # up one side, over the top, down the other
    assert np.ptp(tip[:, 0]) > 0.40
