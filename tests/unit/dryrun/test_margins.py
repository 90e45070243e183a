"""What a motion has to spare: figures known beforehand, shown where it would pass and nowhere else."""

import json
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.dryrun.cell import Cell, scene_cell
from weldsim.dryrun.margins import joint_speeds, margins
from weldsim.dryrun.page import write_page
from weldsim.dryrun.program import Program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.verdict import DryRun, Trial, Verdict, dry_run_json
from weldsim.motion.collision import NEAR
from weldsim.motion.config import MotionConfig
from weldsim.records import Segment
from weldsim.scene.config import FixtureConfig, SceneConfig

DOWN = np.array([0.0, 0.0, -1.0])
HOME = np.array([-1.57, -1.30, -1.90, -1.50, 1.57, 0.0])
LINE = torch_path(flat_curve("line", 0.03) + np.array([0.0, -0.45, 0.03]), DOWN)


@pytest.fixture(scope="module")
def cell() -> Cell:
    return scene_cell(SceneConfig(fixture=FixtureConfig(clamps=0)))


@pytest.fixture(scope="module")
def passed(cell: Cell) -> DryRun:
    return dry_run(Program(source="test", kind="path", paths=(LINE,), names=("seam-1",)), cell, MotionConfig())


def turning(*rows: list[float]) -> Trial:
    """A motion a second a row, each row added to HOME [rad]."""
    q = HOME + np.array(rows)
    return Trial(name="test", verdicts=(Verdict(label="line 1", index=0, s=None),), t=np.arange(len(q), dtype=float), q=q)


def test_range_speed_and_their_joints_are_those_of_the_motion(cell: Cell) -> None:
    trial = turning([0.0] * 6, [0.0, 0.0, 0.0, 0.0, 0.0, 0.5], [0.0, 0.0, -0.2, 0.0, 0.0, 0.5])
    found = {margin.figure: margin for margin in margins(trial, cell, MotionConfig(joint_speed_limit=2.0))}
    speed, room = found["joint speed"], found["joint angle to its end stop"]
    assert (speed.value, speed.limit, speed.t, speed.of) == (
        pytest.approx(np.rad2deg(0.5)),
        pytest.approx(np.rad2deg(2)),
        1,
        "wrist 3",
    )
    assert (room.value, room.t, room.of) == (pytest.approx(np.rad2deg(2 * np.pi - 2.1)), 2.0, "elbow")
    assert joint_speeds(replace(trial, t=np.zeros(3))).max() == 0.0


def test_clearance_is_the_distance_of_the_nearest_bodies(passed: DryRun, cell: Cell) -> None:
    trial = passed.trials[0]
    margin = next(margin for margin in trial.margins if margin.figure == "clearance of arm and torch")
    row = int(np.abs(trial.t - margin.t).argmin())
    model, data = cell.model, mujoco.MjData(cell.model)
    data.qpos[:6] = trial.q[row]
    mujoco.mj_kinematics(model, data)
    bodies = [body.replace(" ", "_") for body in margin.of.split(" from ") if body != "part"]
    names = {name: model.geom(f"{name}_collision").id for name in bodies}
    part = model.geom("part_collision_0").id
    assert len(names) == 1
    distance = mujoco.mj_geomDistance(model, data, next(iter(names.values())), part, 1.0, np.zeros(6))
    # The weld is 10 mm over the part: the nozzle's mouth stays a stick-out of 15 mm above that.
    assert margin.value == pytest.approx(1e3 * distance, abs=0.01)
    assert 20.0 < margin.value < 1e3 * NEAR
    assert not margin.beyond


def test_margins_are_told_where_a_motion_would_pass_alone(passed: DryRun, cell: Cell, tmp_path) -> None:
    text = write_page(tmp_path / "page.html", passed, (b"picture",), speed_limit=3.0).read_text()
    assert ">WOULD PASS</div>" in text
    assert "seam-1: would pass" in text
    assert "Clearance and margins" in text
    drawn, _ = json.JSONDecoder().raw_decode(text, text.rindex("const FIGURES=") + 14)
    limits = [[shape["y0"] for shape in figure["layout"]["shapes"] if shape["type"] == "line"] for figure in drawn]
    assert limits == [pytest.approx([-360, 360]), pytest.approx([-np.rad2deg(3), np.rad2deg(3)])]
    words = [[note["text"] for note in figure["layout"]["annotations"]] for figure in drawn]
    assert words == [["limit +360 deg", "limit -360 deg"], ["limit +172 deg/s", "limit -172 deg/s"]]
    (picture,) = re.findall("<img [^>]*>", text.split("<script>")[0])
    assert 'alt="seam-1: the arm halfway"' in picture
    for figure, (low, high) in zip(drawn, limits, strict=True):
        seen = figure["layout"]["yaxis"]["range"]
        assert seen[0] < low < high < seen[1]
    document = dry_run_json(passed)["trials"][0]["margins"]
    assert [row["figure"] for row in document] == [margin.figure for margin in passed.trials[0].margins]
    far = torch_path(flat_curve("line", 0.03) + np.array([0.0, -1.3, 0.03]), DOWN)
    failed = dry_run(Program(source="test", kind="path", paths=(far,), names=("seam-1",)), cell, MotionConfig(), fix=False)
    assert failed.trials[0].margins == ()
    text = write_page(tmp_path / "page.html", failed).read_text()
    assert ">WOULD FAIL</div>" in text
    assert "Clearance and margins" not in text


def test_a_job_that_passes_shows_no_singularity_beyond_its_limit_though_the_way_home_leads_through_one(
    passed: DryRun, cell: Cell
) -> None:
    trial = passed.trials[0]
    assert trial.trajectory is not None
    air = np.array([one == Segment.AIR for one in trial.trajectory.segments])
    q = trial.q.copy()
    q[np.flatnonzero(air)[-1], 4] = 0.0  # wrist 2 straight: singular
    figure = "least tip travel for a turn of the joints"
    (before, after) = (
        next(one for one in margins(each, cell, MotionConfig()) if one.figure == figure) for each in (trial, replace(trial, q=q))
    )
    assert after == before
    q[np.flatnonzero(~air)[5], 4] = 0.0
    worst = next(one for one in margins(replace(trial, q=q), cell, MotionConfig()) if one.figure == figure)
    assert worst.value < worst.limit
    assert worst.t == trial.t[np.flatnonzero(~air)[5]]


@pytest.mark.parametrize("off", [0.0, 0.012])
def test_a_weld_that_lies_off_the_parts_seam_is_asked_about(cell: Cell, off: float) -> None:
    """Of another part, or over where the part stood before."""
    (seam,) = cell.seams
    path = torch_path(seam[::20] + np.array([0.0, 0.0, off]), DOWN)
    program = Program(source="test", kind="path", paths=(path,), names=("seam-1",))
    notes = dry_run(program, cell, MotionConfig(), fix=False).notes
    assert [note for note in notes if "nearest seam" in note] == (
        []
        if not off
        else [
            f"seam-1 lies up to 12 mm off the nearest seam of the part in {cell.name}: is it that part's, and does the"
            " part stand there?"
        ]
    )
    moved = cell.moved(np.array([0.0, 0.05, 0.0]))
    assert np.allclose(moved.seams[0] - seam, [0.0, 0.05, 0.0])
