"""Programs out of the text that comes in on a script port."""

import pytest

from tests.controllers import new_machine
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
