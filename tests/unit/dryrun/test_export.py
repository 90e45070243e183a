"""The exported program is read back by the dry run, passes, and takes the torch along the path."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from tests.calibrations import calibrated
from tests.controllers import new_machine
from tests.torch_paths import OVER, START, flat_curve, torch_path
from weldsim.arm import Arm
from weldsim.controller.config import ControllerConfig
from weldsim.curves import project
from weldsim.dryrun.cell import empty_cell, scene_cell, shifted
from weldsim.dryrun.reach import reach_map
from weldsim.dryrun.read import read_program
from weldsim.dryrun.sieve import quick
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.try_script import try_script
from weldsim.execution.urscript import script_text
from weldsim.kinematics import torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import HOME

DOWN = np.array([0.0, 0.0, -1.0])


def test_the_exported_program_follows_the_path(tmp_path):
    cell = empty_cell(START)
    path = torch_path(flat_curve("wave", 0.12) + np.array([0.0, -0.45, 0.08]), DOWN)
    trial = try_path(path, "seam", cell, MotionConfig())
    assert trial.passed
    assert trial.trajectory is not None
    file = tmp_path / "weld.script"
    file.write_text(script_text(trial.trajectory))
    program = read_program(file, q_start=START)
    again = try_script(program, cell)
    assert again.passed, again.failure
    tips = torch_pose(again.q[again.arc_on]).p
    assert project(tips, path.X_BT.p)[0].max() < 0.2e-3
    assert project(path.X_BT.p, tips)[0].max() < 0.2e-3
    # Constant speed: as long as the planned weld, to the ramps and the holding of the last target.
    welding = sum(motion.t for motion in program.motions if motion.arc)
    assert abs(welding - trial.trajectory.arc_on.sum() * 0.008) < 0.25
    # Air moves are as slow as the plan has them: the torch's tip keeps below what it may.
    swings = [motion for motion in program.motions if motion.command == "movej"]
    assert len(swings) > 2
    for before, motion in pairwise(swings):
        q = before.q + np.linspace(0, 1, 200)[:, None] * (motion.q - before.q)
        longest = np.abs(motion.q - before.q).max()
        if longest > 1e-6:
            assert _tip_speed(q, longest / motion.speed / 199) < 1.01 * MotionConfig().air_speed
    assert np.abs(again.q[-1] - START).max() < 1e-6
    assert not program.motions[-1].arc


def test_an_arms_own_program_takes_its_torch_along_the_path() -> None:
    """Run by a controller of that arm."""
    calibration = calibrated(0.003, 1)
    arm = Arm(dh=calibration.dh)
    path = torch_path(flat_curve("line", 0.03) + np.array([0.0, -0.48, 0.06]), DOWN, speed=0.02)
    trial = try_path(path, "seam", empty_cell(OVER).fitted(arm), MotionConfig(return_home=False, approach=0.02))
    assert trial.trajectory is not None
    machine = new_machine(config=ControllerConfig(calibration=calibration))
    assert machine.upload(script_text(trial.trajectory, arm=arm, starts=[HOME])), machine.log[-1]
    tips = []
    while machine.program_name and machine.t < 60.0:
        machine.tick()
        if machine.io.digital_out & 1:
            tips.append(machine.snapshot.tcp_pose[:3])
    assert project(np.array(tips), path.X_BT.p)[0].max() < 0.2e-3
    assert project(path.X_BT.p, np.array(tips))[0].max() < 0.5e-3


def _tip_speed(q: np.ndarray, period: float) -> float:
    """Greatest speed of the torch tip [m/s] where neighbouring samples are neighbours in time too."""
    steps = np.linalg.norm(np.diff(torch_pose(q).p, axis=0), axis=1)
    return float(steps[np.abs(np.diff(q, axis=0)).max(axis=1) < 0.05].max()) / period


def test_the_reach_map_is_what_the_arm_can_do():
    cell = empty_cell(START)
    path = torch_path(flat_curve("line", 0.1) + np.array([0.0, -0.45, 0.08]), DOWN)
    found = reach_map(path, cell, MotionConfig(), pitch=0.25)
    # The place where it is now is one of them, and good; on the base itself nothing can be welded.
    j, i = int(np.abs(found.x - found.now[0]).argmin()), int(np.abs(found.y - found.now[1]).argmin())
    assert found.good[i, j]
    near = np.hypot(*np.meshgrid(found.x, found.y)) < 0.12
    assert near.any()
    assert not found.good[near].any()
    assert 0.2 < found.good.mean() < 0.98


def test_a_place_at_which_the_part_stands_in_the_arm_will_not_do():
    """Its seam could be welded there, but the arm would have nowhere to begin."""
    cell = scene_cell(SceneConfig()).moved(np.array([0.15, 0.0, 0.0]))
    path = torch_path(flat_curve("line", 0.05) + np.array([0.15, -0.45, 0.03]), DOWN)
    move = np.array([0.0, 0.25, 0.0])
    assert quick(replace(path, X_BT=shifted(path.X_BT, move)), cell.moved(move), MotionConfig())
    found = reach_map(path, cell, pitch=0.25)
    i, j = int(np.abs(found.y - (found.now[1] + 0.25)).argmin()), int(np.abs(found.x - found.now[0]).argmin())
    assert not found.good[i, j]
    assert found.good.any()
