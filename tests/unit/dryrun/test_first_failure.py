"""Where a job first fails is the first place that a degree-by-degree search refuses, and what is named there is what touches."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.arm import UR5
from weldsim.dryrun.cell import empty_cell, scene_cell
from weldsim.dryrun.fix import applied
from weldsim.dryrun.program import Program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.verdict import dry_run_json
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.kinematics import inverse, torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import plan_motion
from weldsim.motion.rail import make_rail
from weldsim.motion.rungs import make_rungs
from weldsim.mounts import X_FT
from weldsim.records import TorchPath
from weldsim.scene.config import PartPoseConfig, SceneConfig
from weldsim.scene.world import HOME

CONFIG = MotionConfig()
DOWN = np.array([0.0, 0.0, -1.0])


def program(path: TorchPath) -> Program:
    return Program(source="test", kind="path", paths=(path,), names=("seam-1",))


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_the_first_place_out_of_reach_is_so_for_every_degree_of_rotation(heading: float) -> None:
    """Outwards from within reach: the ladder's rotations, ten degrees apart, would give up sooner."""
    u = np.linspace(0.8, 1.3, 300)
    points = np.stack([u * np.sin(heading), -u * np.cos(heading), np.full(len(u), 0.15)], axis=1)
    path, cell = torch_path(points, np.array([0.2, 0.0, -1.0])), empty_cell(START)
    trial = try_path(path, "seam", cell, CONFIG)
    assert trial.failure is not None
    assert trial.s_worst is not None
    rail, exact = make_rail(path, CONFIG), replace(CONFIG, rolls=360)
    at = make_rungs(rail, UR5, exact, cell.collision, at=np.array([trial.s_worst - 0.0012, trial.s_worst]))
    assert [refusal is None for refusal in at.refusals] == [True, False]
    assert at.refusals[1] is not None
    assert at.refusals[1].why == trial.failure.why


def test_a_lead_in_that_fails_is_told_with_its_own_arc_length() -> None:
    path = torch_path(flat_curve("line", 0.1) + np.array([0.0, -1.10, 0.06]), DOWN)
    result = dry_run(program(path), empty_cell(START), CONFIG, fix=False)
    told = dry_run_json(result)["trials"][0]["first_failure"]
    assert told["index"] == 0
    assert told["s"] == pytest.approx(-CONFIG.approach)
    assert told["position"] == pytest.approx([-0.05, -1.10, 0.06 + CONFIG.approach], abs=1e-6)


def test_a_sweep_that_something_forbids_is_a_collision_with_it() -> None:
    """Left of the middle the torch may not look one way, right of it not the other: each place has a posture, the weld has none."""

    def blocked(q: np.ndarray) -> str | None:
        X_BT = torch_pose(q)
        towards = float(X_BT.R[0, 0])
        return (
            "torch touches left wall"
            if X_BT.p[0] < 0 and towards > -0.5
            else "torch touches right wall"
            if (X_BT.p[0] > 0 and towards < 0.5)
            else None
        )

    path = torch_path(flat_curve("line", 0.1) + np.array([0.0, -0.45, 0.1]), DOWN)
    with pytest.raises(MotionError, match=r"no sweep of the arm clear of obstacles .*torch touches (left|right) wall") as caught:
        plan_motion(path, START, CONFIG, blocked=blocked)
    assert caught.value.data["why"] == "collision"
    # The walls meet at the middle: where it breaks is told to a millimetre.
    said = re.search(r"at s = ([0-9.]+) mm of the weld .* goes beyond s = ([0-9.]+) mm", str(caught.value))
    assert said is not None
    assert [float(value) for value in said.groups()] == pytest.approx([50.0, 50.0], abs=1.1)


def test_a_part_that_stands_in_the_arm_is_named_and_moved_away() -> None:
    # The arm is left with its wire 2 mm over the table, amid the part: the nozzle stands in it.
    low = Transform("BT", np.diag([1.0, -1.0, -1.0]), np.array([0.0, -0.45, 0.002])) @ X_FT.inverse()
    waiting = min(inverse(low), key=lambda q: np.abs(q - HOME).max())
    cell = scene_cell(SceneConfig(pose=PartPoseConfig(y=-0.45)), waiting)
    path = torch_path(flat_curve("line", 0.04) + np.array([0.0, -0.45, 0.024]), DOWN)
    result = dry_run(program(path), cell, CONFIG)
    failure = result.trials[0].failure
    assert failure is not None
    assert failure.why == "stale start"
    touch = cell.collision.touch(cell.q_start)
    assert touch is not None
    assert (failure.first, failure.second, failure.depth) == (touch.first, touch.second, touch.depth)
    fix = next(fix for fix in result.fixes[0] if fix.kind == "move the part")
    (moved,), there, settings = applied(fix, path, cell, CONFIG)
    assert try_path(moved, "again", there, settings).passed


def test_rungs_made_before_are_used_as_they_are() -> None:
    path = torch_path(flat_curve("arc", 0.1) + np.array([0.0, -0.45, 0.1]), DOWN)
    rungs = make_rungs(make_rail(path, CONFIG), UR5, CONFIG)
    given, made = plan_motion(path, START, CONFIG, rungs=rungs), plan_motion(path, START, CONFIG)
    assert np.array_equal(given.trajectory.q, made.trajectory.q)
