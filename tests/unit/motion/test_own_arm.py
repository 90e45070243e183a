"""Plans for arms with a calibration of their own: tip on the path by its own kinematics, within limits, clear, or refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.calibrations import ADDED, PUBLISHED, calibrated
from tests.torch_paths import START, flat_curve, random_path, torch_path
from weldsim.arm import UR5, Arm
from weldsim.config import load_scene
from weldsim.curves import arc_length
from weldsim.dryrun.cell import Cell, empty_cell, scene_cell
from weldsim.dryrun.try_path import try_path
from weldsim.errors import MotionError
from weldsim.execution.config import GateConfig
from weldsim.execution.limits import HISTORY, motion_breach
from weldsim.frames import Transform
from weldsim.kinematics import DH
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import plan_motion
from weldsim.motion.rail import make_rail
from weldsim.motion.sweep import first_touch
from weldsim.records import JointTrajectory, Segment, TorchPath

CONFIG = MotionConfig()
ARMS = [PUBLISHED, ADDED, calibrated(0.003, 1).dh, calibrated(0.019, 5).dh]
LINE = flat_curve("line", 0.1) + np.array([0.0, -0.48, 0.06])
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def cell() -> Cell:
    return empty_cell(START)


def off_the_rail(arm: Arm, trajectory: JointTrajectory, path: TorchPath) -> np.ndarray:
    """Distance [m] of the arm's own tip from where it is asked to be, everywhere but in the air."""
    rail = np.array([segment != Segment.AIR for segment in trajectory.segments])
    return np.linalg.norm(arm.torch_tip(trajectory.q) - make_rail(path, CONFIG).at(trajectory.s).p, axis=1)[rail]


@pytest.mark.parametrize("seed", range(len(ARMS)))
def test_the_arms_own_tip_is_on_the_path_and_no_limit_is_exceeded(seed: int, cell: Cell) -> None:
    path, arm = random_path(300 + seed, ("line", "arc", "wave")[seed % 3]), Arm(dh=ARMS[seed])
    here = cell.fitted(arm)
    trial = try_path(path, "seam", here, CONFIG)
    assert trial.passed
    trajectory = trial.trajectory
    assert trajectory is not None
    assert off_the_rail(arm, trajectory, path).max() < 3e-5
    assert off_the_rail(UR5, trajectory, path).max() > 2e-4  # which the nominal arm's angles would not do
    assert (trajectory.q[0] == START).all()
    assert (np.abs(trajectory.q[-1] - START) < 1e-9).all()
    assert np.abs(trajectory.qdd).max() <= CONFIG.joint_acceleration_limit
    rest = np.zeros((HISTORY, 6))
    q = np.concatenate([np.repeat(trajectory.q[:1], HISTORY, axis=0), trajectory.q])
    assert motion_breach(q, np.concatenate([rest, trajectory.qd]), arm.torch_tip(q), CONFIG.period, GateConfig()) is None
    assert first_touch(trajectory.q[::16], here.collision) is None


def test_figures_of_the_nominal_arm_change_no_bit_of_a_plan(cell: Cell) -> None:
    path, same = random_path(300, "wave"), cell.fitted(Arm(dh=DH.copy()))
    assert same is cell
    one, two = (plan_motion(path, START, CONFIG, *arm).trajectory for arm in ((), (Arm(dh=DH.copy()),)))
    assert (one.q == two.q).all()
    assert (one.qdd == two.qdd).all()


@pytest.mark.parametrize("dh", [DH, PUBLISHED, ARMS[3]])
def test_a_path_through_a_singularity_is_refused_with_its_arc_length(dh: np.ndarray) -> None:
    q = START + np.linspace(-0.25, 0.25, 300)[:, None] * np.array([0.2, 0.1, 0.1, 0.0, 1.0, 0.0])
    q[:, 4] -= START[4]  # the wrist's axes are in line in the middle
    X_BT = UR5.torch_pose(q)
    path = replace(torch_path(X_BT.p, DOWN, roll_free=False), X_BT=X_BT, s=arc_length(X_BT.p))

    def other_side(q: np.ndarray) -> str | None:
        """Another shoulder would do: it may not."""
        return "wall" if np.sin(q[0]) > 0 else None

    with pytest.raises(MotionError, match=r"s = -?\d+\.\d mm") as caught:
        plan_motion(path, START, CONFIG, Arm(dh=dh), blocked=other_side)
    assert "\n" not in str(caught.value)
    assert float(str(caught.value.data["s"])) == pytest.approx(path.s[-1] / 2, abs=0.35 * path.s[-1])


@pytest.mark.parametrize("seed", [0, 3])
def test_out_of_reach_is_refused_where_it_is_for_the_nominal_arm(seed: int, cell: Cell) -> None:
    path = torch_path(flat_curve("line", 0.2)[::-1, [1, 0, 2]] + np.array([0.0, -1.1, 0.06]), DOWN)
    trials = [try_path(path, "seam", cell.fitted(arm), CONFIG) for arm in (UR5, Arm(dh=ARMS[seed]))]
    # At the end of its reach an arm is stretched out: either is true there.
    assert {trial.failure.why for trial in trials if trial.failure} <= {"unreachable", "singular"}
    assert all(trial.failure for trial in trials)
    one, two = (trial.s_worst for trial in trials)
    assert one is not None
    assert two == pytest.approx(one, abs=0.015)


def test_an_obstacle_is_judged_by_where_the_arms_own_links_are(cell: Cell) -> None:
    """The same joint angles, the nozzle 5 mm above the table: in it for an arm that stands as much and more lower."""
    X_BT = Transform("BT", torch_path(LINE, DOWN).X_BT.R[0], np.array([0.0, -0.48, -0.01]))
    q = next(q for q in UR5.inverse(X_BT @ UR5.X_FT.inverse()) if cell.collision.touch(q) is None)
    for lift in (-0.004, 0.004, -0.008):
        here = cell.fitted(Arm(dh=DH + np.array([[0.0, 0.0, lift, 0.0], *[[0.0] * 4] * 5])))
        assert here.collision.gap(q) == pytest.approx(0.005 + lift, abs=1e-5)
        assert (here.collision.touch(q) is None) is (lift > -0.005)
    part = scene_cell(load_scene("straight"), START)
    here = part.fitted(Arm(dh=PUBLISHED))
    assert (here.model.body("fixture").pos == part.model.body("fixture").pos).all()
    assert here.moved(np.array([0.01, 0.0, 0.0])).arm is here.arm
    assert here.without("clamp").arm is here.arm
