"""Programs out of the text that comes in on a script port."""

import pytest

from tests.controllers import new_machine
from tests.polyscope_programs import COUNTER, GRIPPER, HEAD_3, HEAD_5, TIMER, exported
from weldsim.controller.script_port import ScriptSession, split_programs

NESTED = "def job():\n  # an end in a comment: end\n  if True:\n    textmsg('end')\n  end\n  while False: end\nend\n"


def test_program_ends_with_its_own_end():
    assert split_programs(NESTED + "textmsg(1)\ndef half():\n") == ([NESTED, "textmsg(1)\n"], "def half():\n")


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_pieces_do_not_matter(size):
    machine = new_machine()
    session = ScriptSession(machine)
    data = (NESTED + "\n\n").encode()
    for k in range(0, len(data), size):
        assert session.received(data[k : k + size]) == b""
    assert machine.program_name == "job"


def test_secondary_program_runs_beside_the_main_one():
    machine = new_machine()
    session = ScriptSession(machine)
    session.received(b"def main_job():\n while True:\n  sync()\n end\nend\n")
    session.received(b"sec side():\n set_digital_out(2, True)\nend\n")
    for _ in range(3):
        machine.tick()
    assert machine.program_name == "main_job"
    assert machine.io.digital_out == 4


def test_new_program_replaces_the_old_one_and_a_bad_one_does_not():
    machine = new_machine()
    assert machine.upload("def one():\n while True:\n  sync()\n end\nend")
    assert not machine.upload("def broken(:\nend")
    assert machine.program_name == "one"
    assert machine.upload("def two():\n while True:\n  sync()\n end\nend")
    assert machine.program_name == "two"


def test_output_that_the_installation_drops_is_low_once_no_program_runs():
    machine = new_machine()
    assert machine.upload("set_digital_out(0, True)\nset_digital_out(5, True)\nsleep(0.1)")
    machine.tick()
    assert machine.io.digital_out == 1 | 1 << 5
    machine.stop_program()
    assert machine.io.digital_out == 1 << 5


@pytest.mark.parametrize(
    ("series", "text", "size", "encoding"),
    [
        ("cb3", exported(HEAD_3, COUNTER, GRIPPER, TIMER), 1, "utf-8"),
        ("e", exported(HEAD_5, COUNTER, TIMER, GRIPPER), 1000, "latin-1"),
    ],
)
def test_a_program_that_polyscope_exported_runs_to_its_end(series, text, size, encoding):
    machine = new_machine(series)
    session = ScriptSession(machine)
    text = text.replace('"Robot Program"', '"Schweißen if"').replace("≟", "=")
    data = f'# für den "end"\r\n{text}'.encode(encoding)
    for k in range(0, len(data), size):
        session.received(data[k : k + size])
    assert machine.program_name == "Weld_1", machine.log
    for _ in range(round(20.0 / machine.profile.period)):
        machine.tick()
        if not machine.program_name:
            break
    assert not machine.program_name
    assert not [said for _, said in machine.log if "failed" in said or "refused" in said or "stop" in said]
    tip = machine.snapshot.tcp_pose[:3]
    assert tip == pytest.approx([-0.03, -0.45, 0.2], abs=1e-3)


def test_a_server_that_is_not_there_is_not_asked_in_vain():
    machine = new_machine("e")
    machine.upload('def job():\n rpc = rpc_factory("xmlrpc", "http://127.0.0.1:1")\n x = rpc.ready()\nend\n')
    machine.tick()
    assert "no server answers" in machine.log[-1][1]
