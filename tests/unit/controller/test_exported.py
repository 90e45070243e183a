"""Exported programs on the controller: they move from where they were checked, and nowhere else."""

from functools import cache

import numpy as np
import pytest

from tests.controllers import new_machine
from tests.torch_paths import flat_curve, torch_path
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.read import read_program
from weldsim.dryrun.try_path import try_path
from weldsim.errors import InputError
from weldsim.execution.urscript import script_text
from weldsim.motion.config import MotionConfig
from weldsim.records import JointTrajectory
from weldsim.scene.world import HOME

ELSEWHERE = HOME + np.array([0.2, 0.0, 0.1, 0.0, 0.0, 0.0])


@cache
def planned() -> JointTrajectory:
    """A short weld, the arm starting ELSEWHERE."""
    path = torch_path(flat_curve("line", 0.02) + np.array([0.0, -0.45, 0.08]), np.array([0.0, 0.0, -1.0]))
    trajectory = try_path(path, "seam", empty_cell(ELSEWHERE), MotionConfig()).trajectory
    assert trajectory is not None
    return trajectory


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_it_says_so_and_does_not_move_where_the_arm_is_elsewhere(series) -> None:
    machine = new_machine(series)
    before = np.array(machine.reference.q)
    assert machine.upload(script_text(planned())), machine.log[-1]
    for _ in range(500):
        machine.tick()
    assert not machine.program_name
    assert np.array_equal(np.array(machine.reference.q), before)
    assert "Move its joints to" in machine.popup


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_it_goes_to_its_start_where_that_way_was_checked(series) -> None:
    machine = new_machine(series)
    assert machine.upload(script_text(planned(), starts=[HOME])), machine.log[-1]
    nearest = np.inf
    for _ in range(round(3.0 / machine.profile.period)):
        machine.tick()
        nearest = min(nearest, float(np.abs(np.array(machine.reference.q) - ELSEWHERE).max()))
    assert nearest < 1e-3
    assert machine.program_name
    assert not machine.popup


def test_a_dry_run_of_it_says_that_it_would_not_move(tmp_path) -> None:
    file = tmp_path / "weld.script"
    file.write_text(script_text(planned()))
    assert len(read_program(file, q_start=ELSEWHERE).motions) > 10
    with pytest.raises(InputError, match="halts before it moves: The arm is not where this program starts"):
        read_program(file, q_start=HOME)
