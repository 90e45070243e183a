"""Random paths about the arm, of which some cannot be done: each is planned within every limit or refused for the true reason."""

import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.curves import project
from weldsim.dryrun.cell import Cell, empty_cell
from weldsim.dryrun.try_path import try_path
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.kinematics import inverse, torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import make_rail
from weldsim.motion.sweep import first_touch
from weldsim.mounts import X_FT
from weldsim.records import Segment, TorchPath

CONFIG = MotionConfig()


@pytest.fixture(scope="module")
def cell() -> Cell:
    return empty_cell(START)


def anywhere(seed: int) -> TorchPath:
    """A seam of 0.1 to 0.3 m on a plane tilted by up to 70 deg, 0.2 to 1.1 m from the base in any direction."""
    rng = np.random.default_rng(seed)
    tilt, heading, yaw = rng.uniform(0, np.deg2rad(70)), rng.uniform(0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
    lean = matrix_from_rotation_vector(tilt * np.array([-np.sin(heading), np.cos(heading), 0.0]))
    R = lean @ matrix_from_rotation_vector(np.array([0.0, 0.0, yaw]))
    angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.2, 1.1)
    middle = np.array([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.02, 0.5)])
    points = flat_curve(("line", "arc")[seed % 2], rng.uniform(0.1, 0.3)) @ R.T + middle
    return torch_path(points, -R[:, 2], speed=rng.uniform(0.004, 0.010), roll_free=bool(rng.random() < 0.7))


def has_solution(X_BT: Transform, free: bool) -> bool:
    """Whether any rotation about the wire, or the given one, has a joint solution."""
    for roll in np.linspace(0, 2 * np.pi, 90, endpoint=False) if free else (0.0,):
        turn = Transform.from_rotation_vector("TT", np.array([0.0, 0.0, roll]), np.zeros(3))
        if len(inverse(X_BT @ turn @ X_FT.inverse())):
            return True
    return False


@pytest.mark.parametrize("seed", range(16))
def test_each_is_planned_within_limits_or_refused_for_the_true_reason(seed: int, cell: Cell) -> None:
    path = anywhere(seed)
    trial = try_path(path, "seam", cell, CONFIG)
    failure = trial.failure
    if failure is None:
        trajectory = trial.trajectory
        assert trajectory is not None
        assert np.abs(trajectory.q).max() <= 2 * np.pi - CONFIG.limit_margin + 1e-6
        assert np.abs(trajectory.qd).max() <= CONFIG.joint_speed_limit
        assert np.abs(trajectory.qdd).max() <= CONFIG.joint_acceleration_limit
        assert np.abs(np.diff(trajectory.qdd, axis=0)).max() / CONFIG.period <= CONFIG.joint_jerk_limit
        assert first_touch(trajectory.q, cell.collision) is None
        assert project(torch_pose(trajectory.q[trajectory.arc_on]).p, path.X_BT.p)[0].max() < 0.05e-3
        weld = np.array([segment == Segment.WELD for segment in trajectory.segments])
        s = trajectory.s[weld]
        inner = (s[1:] > 0.01) & (s[1:] < s[-1] - 0.01)
        assert np.abs(np.diff(s)[inner] / CONFIG.period / path.speed[0] - 1).max() < 0.01
        return
    assert failure.text
    assert failure.why in ("unreachable", "singular", "collision", "joint jump", "orientation jump")
    rail = make_rail(path, CONFIG)
    s = np.linspace(rail.s[0], rail.s[-1], 25)
    reached = np.array([has_solution(pose, path.roll_free) for pose in (rail.at(s)[i] for i in range(25))])
    # What is named comes first: everything before it has a solution, and it has none only where it is called unreachable.
    at = float(failure.text.partition("s = ")[2].partition(" mm")[0]) / 1e3 if "s = " in failure.text else rail.s[-1]
    assert reached[s < at - 2e-3].all()
    if failure.why in ("unreachable", "singular", "collision"):
        assert has_solution(rail.at(np.array([at]))[0], path.roll_free) == (failure.why != "unreachable")
    if failure.why == "joint jump":
        assert reached.all()
    if failure.why == "collision" and trial.q_worst is not None and failure.first:
        assert cell.collision.touch(trial.q_worst) is not None
