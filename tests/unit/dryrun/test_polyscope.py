"""Programs that PolyScope exported: what does not move the arm is passed over and told, what does is checked or refused."""

import numpy as np
import pytest

from tests.controllers import new_machine
from tests.polyscope_programs import ASKED, COUNTER, GRIPPER, HEAD_3, HEAD_5, MOVED, NODES, TIMER, exported
from weldsim.controller.functions import builtins
from weldsim.dryrun.cell import empty_cell
from weldsim.dryrun.read import read_program
from weldsim.dryrun.robot_state import RobotState
from weldsim.dryrun.script_names import ASKING, CHECKED, MOVES, OUTPUTS, RESTING, SILENT
from weldsim.dryrun.try_script import try_script
from weldsim.dryrun.urscript import parse_script
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.kinematics import flange_pose
from weldsim.scene.world import HOME
from weldsim.urscript.geometry import PoseFunctions
from weldsim.urscript.numbers import NumberFunctions
from weldsim.urscript.strings import StringFunctions


def parse(text: str):
    return parse_script(text, source="weld.script", q_start=np.array(HOME))


@pytest.mark.parametrize("head", [HEAD_3, HEAD_5], ids=["3", "5"])
@pytest.mark.parametrize("parts", [(), (COUNTER,), (COUNTER, GRIPPER, TIMER)])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_an_export_is_read_whatever_stands_at_its_head(head, parts, newline) -> None:
    program = parse(exported(head, *parts).replace("\n", newline))
    assert [motion.command for motion in program.motions] == MOVED
    assert np.allclose(program.X_FT.p, [0, 0.048, 0.227])
    told = "; ".join(program.notes)
    assert ("Step_Counter_Thread_2a does not move the arm" in told) == (COUNTER in parts)
    assert "set_gravity" in told


def test_its_main_loop_is_read_for_two_rounds() -> None:
    program = parse(exported(HEAD_5, COUNTER, looping=True))
    assert [motion.command for motion in program.motions] == 2 * MOVED
    assert any("two rounds" in note for note in program.notes)


def test_a_loop_that_stays_at_one_place_is_read_for_two_rounds() -> None:
    nodes = "    movel(End_p, a=1.2, v=0.25)\n    sleep(0.5)\n"
    program = parse(exported(HEAD_5, "  movej([-1.57, -1.3, -1.9, -1.5, 1.57, 0])\n", nodes=nodes, looping=True))
    assert [motion.command for motion in program.motions] == ["movej", "movel", "movel"]


def test_waits_and_choices_that_move_nothing_are_passed_over_and_told() -> None:
    text = exported(HEAD_5, GRIPPER, nodes=NODES + ASKED)
    program = parse(text)
    assert [motion.command for motion in program.motions] == MOVED
    line = next(i for i, row in enumerate(text.splitlines(), 1) if "while (get_standard_digital_in(0)" in row)
    assert f"line {line}: waits for get_standard_digital_in; read as if the wait were over" in program.notes
    assert any("get_configurable_digital_in, moves nothing either way and is passed over" in note for note in program.notes)


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        ("    if (get_standard_digital_in(0)):\n      movel(End_p)\n    end\n", "get_standard_digital_in: .*cannot be told"),
        ("    if (get_standard_digital_in(0)):\n      Down()\n    end\n", "get_standard_digital_in: .*cannot be told"),
        ("    if (get_flag(1)):\n      set_tcp(p[0,0,0,0,0,0])\n    end\n", "get_flag: .*cannot be told"),
        ("    while (get_flag(1)):\n      movel(End_p)\n    end\n", "get_flag: .*cannot be told"),
        ("    while (True):\n      if (get_flag(1)):\n        break\n      end\n      Down()\n    end\n", "get_flag"),
        ("    End_p[2] = get_standard_analog_in(0)\n    movel(End_p)\n", "get_standard_analog_in: .*cannot be told"),
        ("    movel(End_p, v=get_standard_analog_in(0))\n", "get_standard_analog_in: .*cannot be told"),
        ("    if (get_flag(1)):\n      far = 0.1\n    end\n    End_p[0] = far\n    movel(End_p)\n", "get_flag: .*cannot be told"),
        ("    gripper_set(1, 2)\n    if (gripper_open):\n      Down()\n    end\n", "gripper_open, which thread watch_gripper"),
        ("    if (rpc.ready(1)):\n      Down()\n    end\n", r"rpc_factory\.ready: .*cannot be told"),
        (
            "    thread off():\n      Down()\n    end\n    run off()\n",
            r"run: thread off calls movel \(line \d+\): .*cannot be told",
        ),
        ("    thread off():\n      stopl(2)\n    end\n    run off()\n", r"run: thread off calls stopl \(line \d+\)"),
        ("    thread off():\n      force_mode(1, 2, 3, 4, 5)\n    end\n    run off()\n", r"run: thread off calls force_mode"),
        ("    movel(End_p)\n    while (True):\n      sync()\n    end\n", "does not end by itself"),
    ],
)
def test_motions_that_depend_on_what_cannot_be_told_are_refused(nodes, says) -> None:
    with pytest.raises(InputError, match=rf"^weld.script: line \d+: .*{says}"):
        parse(exported(HEAD_5, GRIPPER, nodes=NODES + nodes))


def test_what_a_thread_changes_is_known_until_it_runs() -> None:
    flag = "  ready = False\n  thread watch():\n    ready = get_flag(0)\n  end\n"
    nodes = "    if (not(ready)):\n      Down()\n    end\n"
    assert len(parse(exported(HEAD_5, flag, nodes=NODES + nodes)).motions) == len(MOVED) + 1
    with pytest.raises(InputError, match="ready, which thread watch changes"):
        parse(exported(HEAD_5, flag, "  run watch()\n", nodes=NODES + nodes))
    # A wait for it is over some time, and what the thread is for does not matter.
    waits = "    while (not(ready)):\n      sync()\n    end\n    kill watching\n    join watching\n"
    assert len(parse(exported(HEAD_5, flag, "  watching = run watch()\n", nodes=NODES + waits)).motions) == len(MOVED)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (exported(HEAD_5) + "end\n", "closes nothing"),
        (exported(HEAD_5)[: -len("end\n")], r"expected end of def Weld_1 \(line 1\)"),
        (exported(HEAD_5).replace("    end\n    $ 7", "    $ 7"), r"expected end of def Weld_1 \(line 1\)"),
    ],
)
def test_an_end_that_is_missing_or_too_many_is_named(text, says) -> None:
    with pytest.raises(InputError, match=says):
        parse(text)


def test_names_may_have_letters_of_other_alphabets() -> None:
    text = exported(HEAD_5).replace("End_p", "Nahtende_ü").replace("Loop_1", "焊接_1")
    assert [motion.command for motion in parse(text).motions] == MOVED


def test_controller_and_dry_run_know_the_same_functions() -> None:
    known = set(builtins(new_machine("e")))
    read = {*SILENT, *ASKING, *OUTPUTS, *RESTING, *CHECKED, "set_tcp"}
    assert read <= known
    groups = (PoseFunctions, NumberFunctions, StringFunctions, RobotState)
    read |= {name for group in groups for name in dir(group)}
    assert known - read - MOVES - {"sleep"} == set()


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "utf-8", "utf-8-sig", "utf-16"])
def test_comments_and_messages_may_be_in_any_encoding(tmp_path, encoding) -> None:
    file = tmp_path / "weld.script"
    text = exported(HEAD_5).replace("≟", "=") + "# Schweißnaht für Teil 7, 5 µm\n"
    file.write_bytes(text.replace("def Weld_1():\n", 'def Weld_1():\n  textmsg("Schweißen ° ß")\n').encode(encoding))
    assert [motion.command for motion in read_program(file).motions] == MOVED


def test_waypoints_out_of_reach_are_verdicts_and_all_of_them_are_told() -> None:
    """PolyScope asks for the joints of every waypoint itself."""
    nodes = "".join(
        f"    movej(get_inverse_kin(p[{x}, -0.45, 0.2, 0.0, 3.14, 0.0], qnear=Start_q), a=1.4, v=0.5)\n"
        for x in (0.0, 1.8, 0.05, -1.8, -0.05)
    )
    program = parse(exported(HEAD_5, COUNTER, nodes="    movej(Start_q)\n" + nodes))
    trial = try_script(program, empty_cell(np.array(HOME)))
    assert [verdict.index for verdict in trial.verdicts if verdict.why == "unreachable"] == [2, 4]
    assert "no joint solution for the torch at (1.800, -0.450, 0.200) m" in trial.verdicts[2].text
    asked = "    if (get_inverse_kin_has_solution(p[1.8, -0.45, 0.2, 0.0, 3.14, 0.0])):\n      Down()\n    end\n"
    assert len(parse(exported(HEAD_5, nodes=NODES + asked)).motions) == len(MOVED)
    with pytest.raises(InputError, match="get_inverse_kin: flange at"):
        parse(
            exported(
                HEAD_5, nodes="    q = get_inverse_kin(p[1.8, -0.45, 0.2, 0.0, 3.14, 0.0])\n    movej([q[0], 0, 0, 0, 0, 0])\n"
            )
        )


def test_waypoints_as_joints_of_poses_are_read_with_the_tool_that_is_said() -> None:
    text = f"movej({HOME.tolist()})\nmovej(get_inverse_kin(p[0.0, -0.45, 0.3, 0.0, 3.14, 0.0]))\n"
    assert any("--tool tool0" in note for note in parse(text).notes)
    flange = parse_script(text, source="x", X_FT=Transform("FT", np.eye(3), np.zeros(3)), q_start=np.array(HOME))
    assert not flange.notes
    q = flange.motions[1].q
    assert q is not None
    assert flange_pose(q).p == pytest.approx([0.0, -0.45, 0.3], abs=1e-6)


def test_a_thread_that_would_move_and_is_never_run_is_told() -> None:
    idle = "  thread lift():\n    movel(p[0, -2, 0, 0, 0, 0])\n  end\n"
    line = exported(HEAD_5, idle).splitlines().index("  thread lift():") + 1
    told = f"line {line}: thread lift would move the arm, but is never run: its motions are not checked"
    assert told in parse(exported(HEAD_5, idle)).notes
    assert not any("never run" in note for note in parse(exported(HEAD_5, COUNTER)).notes)


def test_a_list_s_own_functions_are_named_and_the_advice_works() -> None:
    a, b = ("p[0.0, -0.45, 0.3, 0.0, 3.14, 0.0]", "p[0.05, -0.45, 0.3, 0.0, 3.14, 0.0]")
    loop = "i = 0\nwhile i < {}:\n  movel(all[i], v=0.1)\n  i = i + 1\nend\n"
    for text in (f"all = [{a}]\nall.append({b})\n" + loop.format(2), f"all = [{a}, {b}]\n" + loop.format("all.length()")):
        with pytest.raises(InputError, match=r"line \d: \.\w+\(\): a list's own functions are not modelled; write the list out"):
            parse(text)
    assert len(parse(f"all = [{a}, {b}]\n" + loop.format("get_list_length(all)")).motions) == 2
