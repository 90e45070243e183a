"""How failures are told: each with its own reason, in ranges and depths that are true."""

from dataclasses import replace

import numpy as np
import pytest

from weldsim.cli import main
from weldsim.cli.dry_run import failures
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.read import read_program
from weldsim.dryrun.try_script import try_script
from weldsim.dryrun.verdict import Trial, Verdict, runs, span
from weldsim.motion.collision import Touch, deep
from weldsim.scene.world import HOME

HOME_TEXT = f"[{', '.join(f'{q:.6f}' for q in HOME)}]"
START = f"movej({HOME_TEXT})"
FAR, FARTHER = "movel(p[0.0, -1.5, 0.3, 0, 3.14, 0], v=0.1)", "movel(p[0.3, -1.6, 0.3, 0, 3.14, 0], v=0.1)"
IN_TABLE, DEEPER = "movej([-1.57, 0.3, 0, -1.5, 1.57, 0])", "movej([-1.2, 0.5, 0, -1.5, 1.57, 0])"
BEYOND = "movej([-1.57, -1.3, -1.9, -1.5, 1.57, 6.5])"
FAST = f"movej({HOME_TEXT}, v=4)"
WRIST_OVER = "movej([-1.57, -1.30, -1.90, -1.50, 0.02, 0])"
STRAIGHT = "movel(p[0.0, -0.45, 0.3, 0, 3.14, 0], v=0.1)"


def tried(tmp_path, *lines: str) -> Trial:
    file = tmp_path / "job.script"
    file.write_text("\n".join(lines))
    return try_script(read_program(file, q_start=HOME), empty_cell(HOME))


def told(trial: Trial) -> dict[int, str]:
    return {v.line: v.why for v in trial.verdicts if v.why not in ("ok", "not reached")}


@pytest.mark.parametrize(
    ("lines", "reasons"),
    [
        ([START, FAR, FARTHER], {2: "unreachable", 3: "unreachable"}),
        ([START, FAR, IN_TABLE], {2: "unreachable", 3: "collision"}),
        ([START, FAR, BEYOND], {2: "unreachable", 3: "joint limit"}),
        ([START, FAR, "movej([-1.57, -1.3, -1.9, -1.5, 1.57, 0.1], v=4)"], {2: "unreachable", 3: "speed"}),
        ([START, FAR, STRAIGHT, FARTHER], {2: "unreachable", 4: "unreachable"}),
        ([START, IN_TABLE, BEYOND], {2: "collision", 3: "joint limit"}),
        ([START, IN_TABLE, DEEPER, START], {2: "collision", 3: "collision"}),
        ([START, IN_TABLE, FAR, START], {2: "collision", 3: "collision"}),
        ([START, IN_TABLE, "movej([-1.57, -1.3, -1.9, -1.5, 1.57, 0], v=4)"], {2: "collision", 3: "speed"}),
        ([START, BEYOND, FAST], {2: "joint limit", 3: "speed"}),
        ([FAR, FARTHER, IN_TABLE], {1: "unreachable", 2: "unreachable", 3: "collision"}),
    ],
)
def test_the_second_failing_motion_has_its_own_reason(tmp_path, lines, reasons) -> None:
    trial = tried(tmp_path, *lines)
    assert told(trial) == reasons
    rows = [row for row in failures(trial) if row[2] != "not reached"]
    assert [row[0].split()[1] for row in rows] == [str(line) for line in reasons]
    assert [row[2] for row in rows] == list(reasons.values())
    assert len({row[3] for row in rows}) == len(rows)


def test_a_motion_that_only_leads_out_of_the_table_is_no_failure(tmp_path) -> None:
    trial = tried(tmp_path, START, IN_TABLE, START, START)
    assert told(trial) == {2: "collision"}
    assert [v.why for v in trial.verdicts[2:]] == ["not reached", "not reached"]


def test_what_is_too_fast_and_touches_is_told_of_both(tmp_path) -> None:
    text = tried(tmp_path, START, IN_TABLE[:-1] + ", v=4)").verdicts[1].text
    assert "229 deg/s asked for" in text
    assert "touches table" in text


def test_a_collision_is_as_deep_as_it_gets_on_the_way(tmp_path) -> None:
    lines = [START, STRAIGHT, "movel(p[0.0, -0.45, -0.02, 0, 3.14, 0], v=0.1)"]
    shallow = tried(tmp_path, *lines).verdicts[2]
    deeper = tried(tmp_path, *lines[:2], lines[2].replace("-0.02", "-0.03")).verdicts[2]
    assert shallow.why == deeper.why == "collision"
    assert deeper.depth - shallow.depth == pytest.approx(0.01, abs=1e-4)
    assert f"(up to {1e3 * deeper.depth:.1f} mm deep), first at" in deeper.text


def test_no_depth_is_told_as_nought() -> None:
    assert str(Touch(first="torch", second="table", depth=2e-6)) == "torch touches table (under 0.1 mm deep)"
    assert [deep(depth) for depth in (4.9e-5, 5.1e-5, 0.0123)] == ["under 0.1 mm deep", "0.1 mm deep", "12.3 mm deep"]


def verdict(index: int, line: int, command: str = "movel", why="collision", **more) -> Verdict:
    return Verdict(label=f"line {line} {command}", index=index, s=0.0, line=line, command=command, why=why, **more)


@pytest.mark.parametrize("why", ["collision", "unreachable", "singular", "speed", "joint limit"])
def test_only_targets_that_follow_closely_share_a_row(why) -> None:
    failing = [verdict(i, i + 3, why=why, text=f"reason {i}") for i in range(3)]
    assert [a.text for a, _ in runs(tuple(failing))] == ["reason 0", "reason 1", "reason 2"]
    stream = tuple(replace(one, command="servoj") for one in failing)
    assert len(runs(stream)) == 1
    assert len(runs(tuple(replace(one, line=0, command="") for one in failing))) == 1


def test_neighbouring_jumps_are_told_each() -> None:
    poses = tuple(Verdict(label=f"pose {i}", index=i, s=0.01 * i, why="orientation jump", text=f"{i}") for i in range(3))
    assert len(runs(poses)) == 3


def test_a_range_says_where_it_begins_and_ends() -> None:
    late = [verdict(i, line, why="not reached") for i, line in enumerate((8, 2, 9))]
    assert span(late[0], late[0]) == "line 8 movel"
    assert span(late[0], late[1]) == "line 8 movel and the 1 after it"
    assert span(late[0], late[2]) == "line 8 movel to line 9 movel"
    poses = [Verdict(label=f"pose {i}", index=i, s=0.01 * i) for i in (3, 7)]
    assert span(*poses) == "pose 3 to 7"


def test_the_row_of_a_range_is_as_deep_as_it_gets() -> None:
    touches = [Touch(first="a", second="b", depth=depth) for depth in (1e-5, 4e-3, 2e-3)]
    poses = [
        Verdict(label=f"pose {i}", index=i, s=0.0, why="collision", first="a", second="b", depth=touch.depth, text=str(touch))
        for i, touch in enumerate(touches)
    ]
    ((first, last),) = runs(tuple(poses))
    assert (first.depth, last.index) == (4e-3, 2)
    assert first.text == "a touches b (under 0.1 mm deep); up to 4.0 mm deep further on"


def test_motions_of_one_line_are_told_apart(tmp_path, capsys) -> None:
    file = tmp_path / "job.script"
    body = ["def weld(x):", "  movel(p[x, -1.5, 0.3, 0, 3.14, 0], v=0.1)", "end", "def job():", f"  {START}"]
    file.write_text("\n".join([*body, "  weld(0.1)", "  weld(0.2)", f"  {START}", "end", "job()"]))
    assert main(["dry-run", str(file), "--no-fix"]) == 1
    out = capsys.readouterr().out
    assert "4 motions" in out
    assert "line 2 movel (1 of 2)" in out
    assert "line 2 movel (2 of 2)" in out
    assert np.sum(["unreachable" in line for line in out.splitlines()]) == 2
