"""A calibrated arm in the twin, physics and all: told its figures, a job welds the path; not told, it misses by the calibration."""

from dataclasses import replace

import numpy as np

from tests.calibrations import ADDED, calibrated
from tests.torch_paths import OVER, flat_curve, torch_path
from weldsim.arm import Arm
from weldsim.config import CellConfig
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.program import Program
from weldsim.execution.simulated import SimulatedRobot
from weldsim.motion.config import MotionConfig
from weldsim.records import SeamFindings
from weldsim.report.tracking import tracking_error
from weldsim.welding.job import Job, JobConfig, weld

CONFIG = CellConfig(motion=MotionConfig(return_home=False, approach=0.02))
PATH = torch_path(flat_curve("line", 0.03) + np.array([0.0, -0.48, 0.06]), np.array([0.0, 0.0, -1.0]), speed=0.02)


def done(arm: Arm, dh: np.ndarray | None) -> Job:
    """The path given to the arm in the twin; dh is what it tells of itself."""
    cell = empty_cell(OVER)
    robot = SimulatedRobot(cell.fitted(arm).model, OVER)
    facts = robot.facts
    robot.facts = lambda: replace(facts(), dh=dh)  # type: ignore[method-assign]
    program = Program(source="test", kind="path", paths=(PATH,), names=("seam",))
    return weld(
        program, SeamFindings(seams=(), region=np.zeros(0, np.int32), method="none"), robot, cell, CONFIG, JobConfig(arc=True)
    )


def test_a_job_is_done_where_it_was_planned_by_physics_of_the_arm_itself() -> None:
    dh = calibrated(0.015, 2).dh
    job = done(Arm(dh=dh), dh)
    assert job.stopped is None
    assert job.log is not None
    assert not [event for event in job.log.events if event.kind == "contact"]
    assert tracking_error(job.log.X_BT_act.p[job.log.arc_on], PATH.X_BT.p).p95 < 0.2e-3
    off = np.linalg.norm(Arm(dh=dh).torch_tip(job.log.q_act) - job.log.X_BT_act.p, axis=1)
    assert off.max() < 1e-9  # the physics' tip is the figures' tip


def test_an_arm_that_tells_nothing_misses_by_its_calibration() -> None:
    job = done(Arm(dh=ADDED), None)
    assert job.log is not None
    assert 0.5e-3 < tracking_error(job.log.X_BT_act.p[job.log.arc_on], PATH.X_BT.p).max < 6e-3


def test_an_arm_that_tells_figures_it_does_not_move_by_is_refused() -> None:
    job = done(Arm(dh=ADDED), calibrated(0.003, 1).dh)
    assert job.log is None
    assert job.stopped is not None
    assert "base and kinematics" in str(job.stopped)
    assert "\n" not in str(job.stopped)
