"""What PolyScope writes at the head of its programs, and texts in programs."""

import pytest

from tests.controllers import new_machine, run_program
from weldsim.controller.outputs import OutputRecipe

HEAD = """def from_polyscope():
  set_standard_analog_input_domain(0, 1)
  set_standard_analog_input_domain(1, 0)
  set_tool_analog_input_domain(0, 1)
  set_analog_outputdomain(0, 0)
  set_input_actions_to_default()
  set_tool_voltage(24)
  set_runstate_configurable_digital_output_to_value(0, 0)
  set_safety_mode_transition_hardness(1)
  set_gravity([0.0, 0.0, 9.82])
  set_tcp(p[0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
  set_payload(1.5, [0.0, 0.0, 0.05])
  set_flag(31, True)
  write_output_boolean_register(7, get_flag(31))
  write_output_boolean_register(8, get_flag(0))
  write_output_float_register(7, get_tool_analog_in(1))
end
"""


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_a_program_that_polyscope_wrote_runs(series):
    machine = new_machine(series)
    run_program(machine, HEAD)
    assert not [text for _, text in machine.log if "failed" in text]
    assert (machine.io.out_bit[7], machine.io.out_bit[8]) == (True, False)
    assert (machine.io.tool_voltage, machine.io.analog_in_domain, machine.tool.payload) == (24, 0b01, 1.5)
    recipe = OutputRecipe(["tool_output_voltage"], 0.0, machine.profile)
    assert recipe.pack(machine.snapshot) == (24).to_bytes(4, "big")


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ('str_find("a weld", "weld")', 2),
        ('str_find("a weld", "a", 1)', -1),
        ('str_len(str_sub("a weld", 2))', 4),
        ('to_num(str_sub("v12x", 1, 2)) + 1', 13),
        ('floor(to_num("-2.5") * 2)', -5),
        ('to_num(str_at("17", 1))', 7),
    ],
)
def test_texts(code, expected):
    machine = new_machine("cb3")
    run_program(machine, f"def job():\n write_output_integer_register(0, {code})\nend\n")
    assert machine.io.out_int[0] == expected, machine.log[-1]


@pytest.mark.parametrize("code", ['to_num("nan")', 'str_at("abc", 3)', "set_tool_voltage(48)", "set_flag(32, True)", "to_num(3)"])
def test_what_makes_no_sense_ends_the_program(code):
    machine = new_machine("cb3")
    run_program(machine, f"def job():\n x = 1\n {code}\n write_output_integer_register(0, 9)\nend\n")
    assert machine.io.out_int[0] == 0
    assert "failed" in machine.log[-1][1]


def test_a_function_that_an_e_series_alone_has_is_refused_with_the_option_that_works():
    program = "def job():\n set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)\n write_output_integer_register(0, 7)\nend\n"
    old, new = new_machine("cb3"), new_machine("e")
    assert not old.upload(program)
    assert old.log[-1][1].endswith(
        "no function 'set_tool_communication'; an e-Series has it: start the controller with --profile e"
    )
    run_program(new, program)
    assert new.io.out_int[0] == 7
    assert not old.upload("def job():\n set_tool_conversation()\nend\n")
    assert old.log[-1][1].endswith("no function 'set_tool_conversation'")


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_the_tools_feature_is_where_the_tcp_is(series):
    machine = new_machine(series)
    run_program(machine, "def job():\n write_output_float_register(0, point_dist(tool_pose(), get_target_tcp_pose()))\nend\n")
    assert machine.io.out_double[0] == 0
    assert not [text for _, text in machine.log if "failed" in text or "refused" in text]


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("size([[1, 2, 3], [4, 5, 6]])[1]", 3),
        ("size([1, 2, 3])", 3),
        ('size("weld")', 4),
        ("transpose([[1, 2, 3], [4, 5, 6]])[2, 1]", 6),
        ("floor(inv([[2, 0], [0, 0.25]])[1, 1])", 4),
        ("floor(0.5 + 100 * inv(p[0, 0, 0.25, 0, 3.14159265, 0])[2])", 25),
    ],
)
def test_matrices(code, expected):
    machine = new_machine("e")
    run_program(machine, f"def job():\n write_output_integer_register(0, {code})\nend\n")
    assert machine.io.out_int[0] == expected, machine.log[-1:]


@pytest.mark.parametrize(
    "code", ["transpose([1, 2])", "inv([[1, 2], [2, 4]])", "inv([[1, 2, 3]])", "inv(3)", "transpose([[1], [2, 3]])"]
)
def test_what_is_no_matrix_ends_the_program(code):
    machine = new_machine("e")
    run_program(machine, f"def job():\n x = {code}\n write_output_integer_register(0, 9)\nend\n")
    assert machine.io.out_int[0] == 0
    assert "expected" in machine.log[-1][1]
