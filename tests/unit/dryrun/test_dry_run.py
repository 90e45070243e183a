"""Dry runs whose outcome is known beforehand: the reason is the true one, and a fix that is named passes when applied."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.cell import Cell, empty_cell, scene_cell
from weldsim.dryrun.fix import leaned, moved_fix, passes, turned_about_wire
from weldsim.dryrun.program import Program
from weldsim.dryrun.read import read_program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.verdict import dry_run_json, runs
from weldsim.frames import Transform
from weldsim.kinematics import torch_pose
from weldsim.motion.config import MotionConfig
from weldsim.mounts import X_WB
from weldsim.path.config import PathConfig
from weldsim.path.plan import plan_path
from weldsim.records import Seam, TorchPath
from weldsim.scene.config import PartPoseConfig, SceneConfig

DOWN = np.array([0.0, 0.0, -1.0])
HOME = np.array([-1.57, -1.30, -1.90, -1.50, 1.57, 0.0])
CONFIG = MotionConfig()


@pytest.fixture(scope="module")
def empty() -> Cell:
    return empty_cell(START)


def line(x: float = 0.0, y: float = -0.45, z: float = 0.06, length: float = 0.1, **kwargs) -> TorchPath:
    return torch_path(flat_curve("line", length) + np.array([x, y, z]), DOWN, **kwargs)


def program(path: TorchPath) -> Program:
    return Program(source="test", kind="path", paths=(path,), names=("seam-1",))


def test_a_good_path_passes_with_its_cycle_time(empty: Cell) -> None:
    result = dry_run(program(line()), empty, CONFIG)
    assert result.passed
    assert result.fixes == ((),)
    trial = result.trials[0]
    assert 0.1 / 0.008 < result.cycle < 60.0
    assert len(trial.verdicts) == len(line().s)
    assert np.abs(trial.q[0] - START).max() < 1e-6


def test_out_of_reach_says_where_and_a_move_that_passes(empty: Cell) -> None:
    path = line(y=-1.10, length=0.30)
    result = dry_run(program(path), empty, CONFIG)
    failure = result.trials[0].failure
    assert not result.passed
    assert failure is not None
    assert failure.why in ("unreachable", "singular")
    assert "s = " in failure.text
    fix = next(fix for fix in result.fixes[0] if fix.kind == "move the part")
    move = np.array(fix.move)
    assert 0.01 < np.linalg.norm(move) < 0.15
    assert passes(path, move, "again", empty, CONFIG)
    assert not passes(path, 0.5 * move, "again", empty, CONFIG)  # and is near the least that does


def test_a_part_in_the_torchs_way_is_named_with_its_depth() -> None:
    scene = SceneConfig(pose=PartPoseConfig(y=-0.45))
    cell = scene_cell(scene)
    # 12 mm inside the part's top: the nozzle meets it whatever the posture.
    path = line(z=0.0, length=0.12)
    trial = try_path(path, "seam", cell, CONFIG)
    failure = trial.failure
    assert failure is not None
    assert failure.why == "collision"
    assert "part" in failure.first + failure.second
    assert 0.0 < failure.depth < 0.05
    assert trial.q_worst is not None
    touch = cell.collision.touch(trial.q_worst)
    assert touch is not None
    assert {touch.first, touch.second} == {failure.first, failure.second}


def test_the_first_failing_arc_length_is_found_to_a_millimetre() -> None:
    cell = scene_cell(SceneConfig())
    # Down into the part at a slope: at which height the nozzle meets it is found by trying single places.
    n = 120
    points = np.stack([np.linspace(-0.06, 0.06, n), np.full(n, -0.45), np.linspace(0.05, -0.012, n)], axis=1)
    path = torch_path(points, DOWN)
    failure = try_path(path, "seam", cell, CONFIG).failure
    assert failure is not None
    assert failure.s is not None
    assert failure.why == "collision"
    before = try_path(_part(path, failure.s - 0.004), "before", cell, replace(CONFIG, approach=0.0))
    after = try_path(_part(path, failure.s + 0.004), "after", cell, replace(CONFIG, approach=0.0))
    assert before.passed
    assert not after.passed


def test_a_clamp_in_the_torchs_way_is_named_and_without_it_the_weld_passes() -> None:
    cell = scene_cell(SceneConfig())
    clamps = [i for i in range(cell.model.ngeom) if cell.model.geom(i).name == "clamp_0_collision"]
    data = mujoco.MjData(cell.model)
    mujoco.mj_forward(cell.model, data)
    nose = (X_WB.inverse() @ Transform("WB", np.eye(3), data.geom_xpos[clamps[0]])).p
    path = line(x=nose[0], y=nose[1], z=nose[2], length=0.12)
    result = dry_run(program(path), cell, CONFIG)
    failure = result.trials[0].failure
    assert failure is not None
    assert failure.why == "collision"
    assert "clamp_0" in (failure.first, failure.second)
    fix = next(fix for fix in result.fixes[0] if fix.kind == "take away")
    assert fix.body == "clamp_0"
    assert try_path(path, "again", cell.without("clamp_0"), CONFIG).passed


@pytest.mark.parametrize(("work", "travel"), [(0.2, 0.0), (0.0, 0.2), (-0.1, 0.0)])
def test_a_lean_is_that_of_the_path_planner(work: float, travel: float) -> None:
    path = line()
    seam = Seam(points_B=path.X_BT.p, s=path.s, tangents_B=path.X_BT.R[:, :, 0], normals_B=-path.X_BT.R[:, :, 2], width=0.01)
    asked = plan_path(seam, PathConfig(work_angle=work, travel_angle=travel)).X_BT
    upright = plan_path(seam, PathConfig()).X_BT
    assert np.abs(leaned(upright, work, travel).R[..., 2] - asked.R[..., 2]).max() < 1e-6


def _part(path: TorchPath, end: float) -> TorchPath:
    mine = path.s <= end
    k = int(mine.sum())
    return TorchPath(
        X_BT=Transform("BT", path.X_BT.R[:k], path.X_BT.p[:k]),
        s=path.s[:k],
        speed=path.speed[:k],
        arc_on=path.arc_on[:k],
        segments=path.segments[:k],
    )


def test_a_fixed_rotation_that_cannot_be_held_is_turned_about_the_wire() -> None:
    cell = empty_cell(START)
    path = line(y=-0.20, z=0.05, roll_free=False)
    failing = replace(path, X_BT=turned_about_wire(path.X_BT, np.pi))
    assert not try_path(failing, "seam", cell, CONFIG).passed
    result = dry_run(program(failing), cell, CONFIG)
    fix = next(fix for fix in result.fixes[0] if fix.kind == "turn about the wire")
    turned = replace(failing, X_BT=turned_about_wire(failing.X_BT, fix.turn))
    assert try_path(turned, "again", cell, CONFIG).passed


def test_an_orientation_jump_is_called_that(empty: Cell) -> None:
    path = line()
    R = np.array(path.X_BT.R)
    lean = Transform.from_rotation_vector("TT", np.array([np.deg2rad(20), 0, 0]), np.zeros(3)).R
    R[80:] = R[80:] @ lean
    failure = try_path(replace(path, X_BT=Transform("BT", R, path.X_BT.p)), "seam", empty, CONFIG).failure
    assert failure is not None
    assert failure.why == "orientation jump"
    assert failure.index == 80
    assert "20.0 deg" in failure.text


def test_too_fast_is_called_that_and_slower_passes(empty: Cell) -> None:
    result = dry_run(program(line(speed=0.4)), empty, CONFIG)
    failure = result.trials[0].failure
    assert failure is not None
    assert failure.why == "speed"
    fix = result.fixes[0][0]
    assert fix.kind == "slower"
    assert try_path(line(speed=fix.speed), "again", empty, CONFIG).passed


def test_a_start_in_the_table_is_stale() -> None:
    cell = empty_cell(np.array([-1.57, 0.3, 0.0, 0.0, 0.0, 0.0]))
    failure = try_path(line(), "seam", cell, CONFIG).failure
    assert failure is not None
    assert failure.why == "stale start"


def _script(tmp_path, *lines: str):
    file = tmp_path / "job.script"
    file.write_text("\n".join(lines))
    return read_program(file)


def _pose(p, turn=0.0) -> str:
    X = turned_about_wire(Transform("BT", np.diag([1.0, -1.0, -1.0]), np.array(p, float)), turn)
    return "p[" + ", ".join(f"{v:.9f}" for v in (*X.p, *X.rotation_vector)) + "]"


def _joints(q) -> str:
    return "[" + ", ".join(f"{v:.6f}" for v in q) + "]"


def test_a_good_script_passes(tmp_path) -> None:
    cell = empty_cell(HOME)
    below = torch_pose(HOME).p - [0, 0, 0.05]
    R = torch_pose(HOME).rotation_vector
    pose = "p[" + ", ".join(f"{v:.9f}" for v in (*below, *R)) + "]"
    result = dry_run(_script(tmp_path, f"movej({_joints(HOME)})", f"movel({pose}, a=0.5, v=0.05)", "sleep(1.5)"), cell)
    assert result.passed, result.trials[0].failure
    # Trapezoid: 50 mm at 50 mm/s with 0.5 m/s2, then the pause.
    assert result.cycle == pytest.approx(1.1 + 1.5, abs=0.02)


@pytest.mark.parametrize(
    ("lines", "why", "index"),
    [
        (["movej({home})", "movel(p[0.0, -1.2, 0.3, 3.1, 0, 0], v=0.1)"], "unreachable", 1),
        (["movej([-1.57, -1.3, -1.9, -1.5, 1.57, 6.5])", "movej({home})"], "joint limit", 0),
        (["movej({home}, v=1.0)", "movej([0.5, -1.3, -1.9, -1.5, 1.57, 0], v=4.0)"], "speed", 1),
        (["servoj([-1.40, -1.3, -1.9, -1.5, 1.57, 0], t=0.008)", "movej({home})"], "stale start", 0),
        (["servoj({home}, t=0.008)", "servoj([-1.40, -1.3, -1.9, -1.5, 1.57, 0], t=0.008)"], "joint jump", 1),
        (["servoj({home}, t=0.008)", "servoj([-1.52, -1.3, -1.9, -1.5, 1.57, 0], t=0.008)"], "speed", 1),
        (["movej({home})", "movej([-1.57, 0.3, 0, -1.5, 1.57, 0])"], "collision", 1),
    ],
)
def test_every_reason_is_the_true_one(tmp_path, lines, why, index) -> None:
    cell = empty_cell(HOME)
    trial = dry_run(_script(tmp_path, *(text.format(home=_joints(HOME)) for text in lines)), cell, fix=False).trials[0]
    failure = trial.failure
    assert failure is not None
    assert (failure.why, failure.index) == (why, index), failure.text
    assert all(verdict.why == "not reached" for verdict in trial.verdicts[index + 1 :])


def test_ranges_cover_every_waypoint(empty: Cell) -> None:
    result = dry_run(program(line(y=-1.10, length=0.30)), empty, CONFIG, fix=False)
    document = json.loads(json.dumps(dry_run_json(result), allow_nan=False))
    ranges = document["trials"][0]["waypoints"]
    covered = [i for entry in ranges for i in range(entry["from"], entry["to"] + 1)]
    assert covered == list(range(len(result.trials[0].verdicts)))
    assert len(runs(result.trials[0].verdicts)) == len(ranges)
    assert not document["passed"]
    assert document["trials"][0]["first_failure"]["verdict"] != "ok"


def test_a_move_is_said_in_millimetres() -> None:
    assert moved_fix(np.array([0.03, -0.04, 0.0])).text == "move the part by 50 mm: (+30, -40) mm along x and y of the base"


def test_the_command_exits_0_1_and_2(tmp_path, capsys) -> None:
    good, bad = tmp_path / "good.script", tmp_path / "bad.script"
    good.write_text(f"movej({_joints(HOME)})\nmovej({_joints(HOME + 0.05)})\n")
    bad.write_text(f"movej({_joints(HOME)})\nmovel(p[0, -1.2, 0.3, 3.1, 0, 0])\n")
    page, out = tmp_path / "page.html", tmp_path / "out.json"
    assert main(["dry-run", str(good), "--out", str(out), "--html", str(page)]) == 0
    assert json.loads(out.read_text())["passed"]
    assert "WOULD PASS" in page.read_text()
    assert main(["dry-run", str(bad), "--no-fix", "--json"]) == 1
    lines = capsys.readouterr().out
    assert json.loads(lines[lines.index("{\n") :])["trials"][0]["first_failure"]["verdict"] == "unreachable"
    bad.write_text("movej([1,2])")
    assert main(["dry-run", str(bad)]) == 2
    assert main(["dry-run", str(good), "--start", "1,2,3"]) == 2
    assert main(["dry-run", str(good), "--scene", "nowhere"]) == 2
    assert main(["dry-run", str(good), "--scene", "straight", "--empty"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 4


def test_the_thesis_program_would_pass_as_tool0_and_fail_as_torch(real_data) -> None:
    file = real_data / "thesis_paths/ur_y_shape.csv"
    cell = empty_cell()
    assert dry_run(read_program(file), cell).passed
    wrong = dry_run(read_program(file, tool="torch"), cell, fix=False)
    assert not wrong.passed
