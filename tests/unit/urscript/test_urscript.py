"""The URScript language: what programs mean, and what is said of those that mean nothing."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from weldsim.urscript.compiler import compile_program
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.program import Program


def run(text: str, periods: int = 50) -> list[tuple]:
    """What a program has noted when it ended, each note after the number of control periods before it."""
    notes: list[tuple] = []
    now = 0

    def note(*values: Any) -> None:
        notes.append((now, *values))

    def sync() -> Iterator[None]:
        yield

    builtins: dict[str, Callable] = {"note": note, "sync": sync}
    program = Program(compile_program(text, builtins), builtins)
    while program.running and now < periods:
        program.step()
        now += 1
    return notes


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2 * 3", 7),
        ("-2 * -3", 6),
        ("(1 + 2) * 3", 9),
        ("7 % 4", 3),
        ("1 / 4", 0.25),
        ("0x1F", 31),
        ("1e-3", 0.001),
        (".5", 0.5),
        ("not 1 == 2", True),
        ("True and not False", True),
        ("True xor True", False),
        ("1 < 2 or 1 / 0 == 1", True),
        ("p[1, 2, 3, 4, 5, 6]", [1, 2, 3, 4, 5, 6]),
        ("[1, 2 + 3][1]", 5),
        ("[[1, 2], [3, 4]][1, 0]", 3),
        ("'single'", "single"),
        ('"a # is no comment"', "a # is no comment"),
    ],
)
def test_expressions(expression, value):
    assert run(f"note({expression})") == [(0, value)]


def test_newlines_mean_nothing():
    # ur_rtde's own script puts a value on the line after its `=`.
    assert run("def p():\n global offset = # a comment\n0 global b = 1\n note(offset,\n  b)\nend") == [(0, 0, 1)]


def test_lists_are_values():
    text = """
def p():
  global a = [1, 2, 3]
  def change(x):
    x[0] = 9
    return x
  end
  b = a
  b[1] = 7
  note(a, b, change(a), a)
end"""
    assert run(text) == [(0, [1, 2, 3], [1, 7, 3], [9, 2, 3], [1, 2, 3])]


def test_functions_have_their_own_variables_and_share_the_global_ones():
    text = """
def p():
  global shared = 1
  def f(x, y = 10):
    own = x + y
    shared = shared + own
    return own
  end
  own = 5
  note(f(1), f(1, y = 2), shared, own)
  local q = 3
  note(q)
end"""
    # `own` is assigned in the program's body, so that functions assign the same variable.
    assert run(text) == [(0, 11, 3, 15, 3), (0, 3)]


def test_local_hides_what_is_shared():
    assert run("def p():\n x = 1\n def f():\n  local x = 2\n  return x\n end\n note(f(), x)\nend") == [(0, 2, 1)]


def test_loops_and_branches():
    text = """
i = 0
while True:
  i = i + 1
  if i == 2: continue
  elif i > 3: break
  else: note(i) end
end
note("done", i)"""
    assert run(text) == [(0, 1), (0, 3), (0, "done", 4)]


def test_threads_run_side_by_side_until_killed():
    text = """
def p():
  global n = 0
  thread count():
    while True:
      n = n + 1
      sync()
    end
  end
  h = run count()
  i = 0
  while i < 5: i = i + 1 sync() end
  kill h
  before = n
  sync() sync()
  note(before, n)
end"""
    assert run(text) == [(7, 5, 5)]


def test_join_waits_for_a_thread_and_killing_nobody_does_nothing():
    text = """
def p():
  thread three(): sync() sync() sync() end
  kill 0
  h = run three()
  join h
  note(True)
end"""
    assert run(text) == [(4, True)]


def test_critical_section_holds_the_others():
    text = """
def p():
  global log = 0
  thread other():
    while True: log = log + 1 sync() end
  end
  run other()
  sync()
  enter_critical
  a = log
  sync() sync()
  b = log
  exit_critical
  sync() sync()
  note(b - a, log - b)
end"""
    assert run(text) == [(5, 0, 2)]


def test_halt_ends_everything():
    assert run("note(1)\nhalt\nnote(2)") == [(0, 1)]


def test_p_can_be_a_variable():
    assert run("def prog():\n def first(p):\n  return p[0] + p[1]\n end\n note(first([1, 2]))\nend") == [(0, 3)]


def test_names_that_python_reserves_are_free():
    assert run("def p():\n async = 1\n lambda = 2\n class = [async, lambda]\n note(class)\nend") == [(0, [1, 2])]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("def p():\n x = 1\n", "line 3: expected end"),
        ("x = y", "line 1: variable 'y' is not defined"),
        ("\n\nnothing(1)", "line 3: there is no function 'nothing'"),
        ("sync(1)", "line 1: sync"),
        ("x = [1, 2", "line 1"),
        ("x = 1 +", "expected a value"),
        ("1 = 2", "only a variable"),
        ("def f(x):\n note(x)\nend\nf(1, 2)", "f() takes (x)"),
        ("x = @", "no meaning"),
        ("run sync()", "not a thread or function"),
        ("note(x = 1, 2)", "without a name follows"),
        ("break", "line 1"),
        ("(" * 400 + "1" + ")" * 400, "nested"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_line(text, said):
    with pytest.raises(ScriptError) as caught:
        run(text)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = [1]\nnote(a[1])", "line 2: index 1 is not one of 0 to 0"),
        ("a = 1\nnote(a[0])", "line 2: a number has no elements"),
        ("a = [1] + [2]", "expected a number, not a list"),
        ("a = 1 + True", "expected a number, not True"),
        ("a = 1 / 0", "division by zero"),
        ("sync()\nwhile True:\n a = 1\nend", "line 2: infinite loop"),
        ("def p():\n global x = 1\n def f():\n  return f()\n end\n f()\nend", "nested too deeply"),
        ("if 1 == 2: x = 1 end\nnote(x)", "line 2: variable 'x' is used before it is assigned"),
        ("set_tcp(p[0, 0, 0])", "line 1: a pose p[...] has six values, not 3"),
        ("p = p[1, 2, 3, 4, 5, 6]\np[0] = [1]", "line 2: expected a number"),
    ],
)
def test_what_fails_while_it_runs_says_where(text, said):
    with pytest.raises(ScriptError) as caught:
        run(text)
    assert said in str(caught.value)


def test_nothing_of_the_text_is_python():
    with pytest.raises(ScriptError):
        run("__import__('os')")
    text = "\\'); __import__('os"
    assert run(f'note("{text}")') == [(0, text)]
