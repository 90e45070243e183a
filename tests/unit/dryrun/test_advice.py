"""What an error or a note tells people to do, done: the complaint is gone."""

from dataclasses import replace

import numpy as np
import pytest

from tests.controllers import new_machine, run_program
from tests.torch_paths import START, flat_curve, torch_path
from weldsim.cli import main
from weldsim.curves import arc_length
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.read import read_program
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.try_script import try_script
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.motion.config import MotionConfig
from weldsim.scene.world import HOME

DOWN = np.array([0.0, 0.0, -1.0])
POSE = "p[0.0, -0.45, 0.2, 0.0, 3.14, 0.0]"
HOME_TEXT = f"[{', '.join(f'{q:.6f}' for q in HOME)}]"


@pytest.mark.parametrize(
    ("says", "wrong", "right"),
    [
        ("begin with movej to six joint angles", "a = get_actual_tcp_pose()\nmovel(a)", f"movej({HOME_TEXT})\n"),
        ("begin with movej to six joint angles", f"movel(get_inverse_kin({POSE}))", f"movej({HOME_TEXT})\n"),
    ],
)
def test_a_program_that_asks_where_the_arm_is(tmp_path, says, wrong, right) -> None:
    file = tmp_path / "job.script"
    text = f"{wrong}\nmovel({POSE})\n"
    file.write_text(text)
    with pytest.raises(InputError, match=says):
        read_program(file)
    file.write_text(right + text)
    assert len(read_program(file).motions) == 3


@pytest.mark.parametrize("moving", ["optimovel({0})", "speedl([0, 0, 0.1, 0, 0, 0])", "servoc({0})"])
def test_motions_that_are_not_checked_in_another_way(tmp_path, moving) -> None:
    file = tmp_path / "job.script"
    file.write_text(f"movej({HOME_TEXT})\n{moving.format(POSE)}\n")
    with pytest.raises(InputError, match="its motion is not checked; use movej, movel, movep, movec or servoj"):
        read_program(file)
    for name in ("movej", "movel", "movep", "servoj"):
        file.write_text(f"movej({HOME_TEXT})\n{name}({POSE})\n")
        assert [motion.command for motion in read_program(file).motions] == ["movej", name]


def test_a_servoj_that_begins_elsewhere(tmp_path) -> None:
    file, cell = tmp_path / "job.script", empty_cell(np.array(HOME))
    target = f"[{', '.join(f'{q + 0.1:.6f}' for q in HOME)}]"
    file.write_text(f"servoj({target}, t=0.008)\nservoj({target}, t=0.008)\n")
    failure = try_script(read_program(file), cell).failure
    assert failure is not None
    assert "movej there first" in failure.text
    file.write_text(f"movej({target})\n" + file.read_text())
    assert try_script(read_program(file), cell).passed


WAITS = "[0.500000, -1.300000, -1.900000, -1.500000, 1.570000, 0.000000]"
GUARDED = f"""def job():
  q = get_actual_joint_positions()
  there = {WAITS}
  if norm(q[0] - there[0]) > 0.01 or norm(q[2] - there[2]) > 0.01:
    popup("Not at the start.")
    halt
  end
  movej({WAITS})
  movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0.01, 0, 0, 0]), v=0.05)
end
"""


def test_a_program_that_halts_by_where_the_arm_stands_goes_on_from_the_start_that_is_named(tmp_path, capsys) -> None:
    file = tmp_path / "job.script"
    file.write_text(GUARDED)
    assert main(["dry-run", str(file), "--no-fix"]) == 2
    said = capsys.readouterr().err.strip()
    assert said.startswith(f"weldsim: {file}: line 6: halts before it moves: Not at the start; with --start ")
    assert main(["dry-run", str(file), "--no-fix", "--start", said.split('"')[1]]) == 0
    assert "--start" not in capsys.readouterr().out
    file.write_text(GUARDED.replace(f"there = {WAITS}", "there = [0.5, 0, -1.9]").replace(f"movej({WAITS})", "movej(q)"))
    assert main(["dry-run", str(file), "--no-fix"]) == 2
    assert "it asks where the arm stands (get_actual_joint_positions): say that with --start" in capsys.readouterr().err
    assert main(["dry-run", str(file), "--no-fix", "--start", WAITS[1:-1]]) == 0


def test_a_program_that_halts_whatever_the_arm_does(tmp_path, capsys) -> None:
    file = tmp_path / "job.script"
    for before, count in (("", "before it moves"), (f"movej({HOME_TEXT})\n", "after 1 motion")):
        text = f'{before}popup("no wire")\nhalt\nmovej({HOME_TEXT})\nmovel({POSE}, v=0.1)\n'
        file.write_text(text)
        assert main(["dry-run", str(file), "--no-fix"]) == 2
        assert f"halts {count}: no wire; take the halt out to have what follows checked" in capsys.readouterr().err
        file.write_text(text.replace("halt\n", ""))
        assert main(["dry-run", str(file), "--no-fix"]) == 0
        capsys.readouterr()


def test_what_follows_a_halt_is_told_to_be_unread(tmp_path) -> None:
    file = tmp_path / "job.script"
    file.write_text(f"movej({HOME_TEXT})\nmovel({POSE}, v=0.1)\nhalt\nmovel(p[0, -2, 0, 0, 0, 0])\n")
    program = read_program(file)
    assert len(program.motions) == 2
    assert "line 3: halts after 2 motions; what comes after it is not read" in program.notes


@pytest.mark.parametrize(
    ("first", "noted"),
    [
        (f"movel({POSE}, v=0.1)", "line 1: the first motion is a movel to a pose"),
        (f"movej({POSE})", "line 1: the first motion is a movej to a pose"),
        (f"movel({HOME_TEXT}, v=0.1)", "line 1: the first motion is a movel"),
        ("movej(get_actual_joint_positions())", "the program asks where the arm stands before its first motion"),
        (f"movej({HOME_TEXT})", ""),
    ],
)
def test_a_program_that_begins_where_the_arm_stands_says_where_that_is_taken_to_be(tmp_path, capsys, first, noted) -> None:
    file = tmp_path / "job.script"
    file.write_text(f"{first}\nmovel({POSE}, v=0.1)\n")
    main(["dry-run", str(file), "--no-fix"])
    out = capsys.readouterr().out
    assert ("--start says where it does" in out) == bool(noted)
    assert noted in out
    main(["dry-run", str(file), "--no-fix", "--start", HOME_TEXT[1:-1]])
    assert "--start" not in capsys.readouterr().out


def test_a_servoj_that_begins_where_the_arm_is_said_to_stand(tmp_path) -> None:
    file = tmp_path / "job.script"
    file.write_text(f"servoj({WAITS}, t=0.008)\nservoj({WAITS}, t=0.008)\n")
    failure = try_script(read_program(file), empty_cell(np.array(HOME))).failure
    assert failure is not None
    assert "or say where it really stands (--start)" in failure.text
    there = np.array([float(q) for q in WAITS[1:-1].split(",")])
    assert try_script(read_program(file), empty_cell(there)).passed


@pytest.mark.parametrize("name", ["job.script", "job.csv"])
def test_an_arm_that_is_said_to_stand_in_the_table(tmp_path, capsys, name) -> None:
    file = tmp_path / name
    poses = ["0.0,-0.45,0.2,0.0,3.14,0.0", "0.05,-0.45,0.2,0.0,3.14,0.0"]
    file.write_text("\n".join(f"movej(p[{pose}], v=0.2)" if name.endswith("script") else pose for pose in poses))
    argv = ["dry-run", str(file), "--no-fix", "--tool", "torch", *(["--roll"] if name.endswith("csv") else [])]
    assert main([*argv, "--start", "-1.57, 0.3, 0, 0, 0, 0"]) == 1
    assert "(--start)" in capsys.readouterr().out
    assert main([*argv, "--start", HOME_TEXT[1:-1]]) == 0, capsys.readouterr().out


def test_a_jump_of_orientation_that_is_smoothed() -> None:
    path = torch_path(flat_curve("line", 0.1) + np.array([0.0, -0.45, 0.06]), DOWN)
    R, n = np.array(path.X_BT.R), len(path.s)
    leaned = Transform.from_rotation_vector("TT", np.array([0.2, 0.0, 0.0]), np.zeros(3)).R
    R[80:] = R[80:] @ leaned
    config = MotionConfig()
    failure = try_path(replace(path, X_BT=Transform("BT", R, path.X_BT.p)), "seam", empty_cell(START), config).failure
    assert failure is not None
    assert "smooth the path" in failure.text
    u = np.clip((np.arange(n) - 40) / 80, 0, 1)
    lean = (u**2 * (3 - 2 * u))[:, None] * np.array([0.2, 0.0, 0.0])
    smooth = path.X_BT.R @ Transform.from_rotation_vector("TT", lean, np.zeros((n, 3))).R
    assert try_path(replace(path, X_BT=Transform("BT", smooth, path.X_BT.p)), "seam", empty_cell(START), config).passed


def test_a_turn_in_place_is_a_jump_and_every_one_is_told() -> None:
    path = torch_path(flat_curve("line", 0.1) + np.array([0.0, -0.45, 0.06]), DOWN)
    twice = np.repeat(np.arange(0, len(path.s), 12), 2)
    R = np.array(path.X_BT.R[twice])
    R[1::2] = R[1::2] @ Transform.from_rotation_vector("TT", np.array([0.03, 0.0, 0.0]), np.zeros(3)).R
    p = path.X_BT.p[twice]
    turning = replace(
        path,
        X_BT=Transform("BT", R, p),
        s=arc_length(p),
        speed=path.speed[twice],
        arc_on=path.arc_on[twice],
        segments=tuple(path.segments[i] for i in twice),
    )
    trial = try_path(turning, "seam", empty_cell(START), MotionConfig())
    assert [verdict.index for verdict in trial.verdicts if verdict.why == "orientation jump"] == list(range(1, len(twice), 2))


@pytest.mark.parametrize(
    ("rows", "says", "change"),
    [
        ("0,1,-0,45,0,1,3,1,0,0,0,01", "decimal commas need ; between the columns", "0,1;-0,45;0,1;3,1;0,0;0,01"),
        ("7,0.1,-0.45,0.1,3.1,0,0.01,99", "name them on the first line", "n,x,y,z,rx,ry,rz,i\n7,0.1,-0.45,0.1,3.1,0,0.01,99"),
        (
            "x [mm],y,z,rx,ry,rz\n100,-0.45,0.1,3.1,0,0.01",
            "give each of them the same",
            "x [m],y,z,rx,ry,rz\n0.1,-0.45,0.1,3.1,0,0.01",
        ),
        ("X,Y,Z,A,B,C\n0.1,-0.45,0.1,3.1,0,0.01", "x y z rx ry rz", "X,Y,Z,RX,RY,RZ\n0.1,-0.45,0.1,3.1,0,0.01"),
    ],
)
def test_a_table_that_is_written_as_asked(tmp_path, rows, says, change) -> None:
    file = tmp_path / "poses.csv"

    def written(text: str) -> None:
        *head, row = text.split("\n")
        file.write_text("\n".join([*head, row, row.replace("0,1", "0,2", 1).replace("0.1", "0.2", 1)]))

    written(rows)
    with pytest.raises(InputError, match=says):
        read_program(file)
    written(change)
    assert read_program(file, tool="torch").paths[0].X_BT.p[0] == pytest.approx([0.1, -0.45, 0.1])


def test_a_loop_that_never_waits() -> None:
    machine = new_machine("e")
    run_program(machine, "def job():\n  while True:\n    x = 1\n  end\nend\n", seconds=0.1)
    assert "call sync() in it" in machine.log[-1][1]
    run_program(machine, "def job():\n  while True:\n    x = 1\n    sync()\n  end\nend\n", seconds=0.1)
    assert machine.program_name == "job"
