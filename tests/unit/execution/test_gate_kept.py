"""What the gate keeps, counts and forgets: commands and reports in its black box, how far back it looks, what a stop leaves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import weldsim.execution.gate as gate_module
from tests.torch_paths import START
from tests.unit.execution.test_gate import WIDE, Puppet
from tests.unit.execution.test_gate_told import ELBOW, PERIOD, STILL, STOPPED, ready, refused, state_at, still
from weldsim.errors import ExecutionError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.config import GateConfig
from weldsim.execution.gate import SafetyGate
from weldsim.execution.limits import HISTORY
from weldsim.kinematics import torch_pose
from weldsim.records import Event, RobotState, Segment

WRIST_3 = np.eye(6)[5]  # which stands at 0 in START: its angles are exact


def test_without_a_word_the_arc_may_not_burn_and_nothing_is_labelled() -> None:
    gate = SafetyGate(Puppet())
    gate.connect()
    with pytest.raises(ExecutionError, match=r"without permission .* s = 0\.0 mm of the air") as caught:
        gate.set_arc(True)
    assert (caught.value.data["s"], caught.value.data["segment"]) == (0.0, "air")


def test_what_is_told_of_long_ways_is_in_millimetres() -> None:
    puppet = Puppet()
    gate = ready(puppet, config=GateConfig(tracking=0.5, tracking_tip=0.02))
    radius = float(np.linalg.norm(torch_pose(START).p[:2]))
    puppet.offset = 2 * np.arcsin(0.0345 / (2 * radius)) * np.eye(6)[0]  # a chord of 34.5 mm
    assert str(refused(gate)).startswith("tracking: torch tip is 34.50 mm off the weld (limit 20.00 mm)")
    plan = still(START)
    plan = replace(plan, s=0.4 + plan.s, qd=3.5 * ELBOW * (np.arange(20) == 7)[:, None])
    with pytest.raises(ExecutionError, match=r"s = 407\.0 mm of the air"):
        ready(Puppet(), steps=0).check(plan)


def test_a_value_equal_to_its_limit_is_no_breach() -> None:
    limits = GateConfig()
    puppet = Puppet()
    gate = ready(puppet, Segment.AIR)
    puppet.offset = limits.tracking * WRIST_3
    gate.servo(START, STILL)
    ready(Puppet(), steps=0).servo(START + limits.start_tolerance * WRIST_3, STILL)
    off = np.linalg.norm(gate.arm.torch_tip(START + 0.001 * ELBOW) - gate.arm.torch_tip(START))
    for limit, kept in ((float(off), True), (float(np.nextafter(off, 0.0)), False)):
        puppet = Puppet()
        gate = ready(puppet, config=GateConfig(tracking_tip=limit))
        puppet.offset = 0.001 * ELBOW
        if kept:
            gate.servo(START, STILL)
        else:
            assert refused(gate).data["what"] == "torch tip"


@pytest.mark.parametrize(("periods", "kept"), [(0, 2), (1, 2), (2, 2), (4, 4), (25, 25)])
def test_an_arm_may_stand_where_it_was_sent_as_many_commands_ago_as_the_lag_has(periods: int, kept: int) -> None:
    """The arm stands; each command is a step on. The oldest of those kept is then one step further off with each command."""
    step = 0.0005
    puppet = Puppet()
    gate = ready(puppet, Segment.AIR, steps=0, config=replace(WIDE, lag=periods * PERIOD, tracking=0.75 * step))
    puppet.deaf = True
    for k in range(kept):
        gate.servo(START + k * step * WRIST_3, STILL)
    error = refused(gate, START + kept * step * WRIST_3)
    assert error.data["rule"] == "tracking"
    assert error.data["value"] == pytest.approx(step)


def test_a_motion_begins_at_rest_where_it_is_said_to() -> None:
    """4 mrad in the first 8 ms, out of rest."""
    first = START + 0.004 * WRIST_3
    ready(Puppet(), steps=0).servo(first, STILL)  # which begins there, within the tolerance of where the arm stands
    gate = ready(Puppet(), steps=0)
    gate.start_from(START)
    error = refused(gate, first)
    assert (error.data["rule"], error.data["value"]) == ("joint acceleration", pytest.approx(0.004 / PERIOD**2))


def test_the_start_of_a_trajectory_is_its_first_point() -> None:
    plan = still(START)
    away = np.where(np.arange(20)[:, None] > 0, START + 0.009 * ELBOW, START)
    with pytest.raises(ExecutionError, match=r"^trajectory: joint acceleration: elbow"):
        ready(Puppet(), steps=0).check(replace(plan, q=away))


def test_angles_and_speeds_reach_the_robot_as_they_are() -> None:
    puppet, got = Puppet(), []
    send = puppet.servo
    puppet.servo = lambda q, qd: (got.append((q, qd)), send(q, qd))[1]  # type: ignore[method-assign]
    gate = ready(puppet, steps=1)
    q, qd = START + 1e-5 * ELBOW, 1e-3 * ELBOW
    gate.servo(q, qd)
    assert got[-1][0] is q
    assert got[-1][1] is qd


def test_each_command_is_judged_with_the_few_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the motion: older ones were judged in their time."""
    lengths, judge = [], gate_module.motion_breach
    monkeypatch.setattr(gate_module, "motion_breach", lambda q, *more: (lengths.append(len(q)), judge(q, *more))[1])
    ready(Puppet(), steps=10)
    assert lengths == [HISTORY + 1] * 10


def test_an_arc_that_burns_from_the_first_has_its_time_to_go_off() -> None:
    puppet = Puppet()
    puppet.burning = True
    assert refused(ready(puppet, steps=12)).data["value"] == pytest.approx(13 * PERIOD)


@pytest.mark.parametrize("how", ["stop", "disconnect"])
def test_an_arc_that_was_asked_for_is_not_after_a_stop(how: str) -> None:
    gate = ready(Puppet())
    gate.set_arc(True)
    gate.servo(START, STILL)
    getattr(gate, how)()
    gate.connect()
    gate.label(Segment.AIR, 0.0)
    gate.servo(START, STILL)
    assert not gate.arc


def test_a_robots_own_stop_is_told_with_the_causes_that_it_does_not_name() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    causes = tuple(Event(t=0.0, kind="cause", text=text) for text in ("speed of wrist 1", "joint 4 is hot"))

    def fail(*_: object) -> np.ndarray:
        raise ExecutionError("protective stop: speed of wrist 1", rule="robot")

    puppet.servo, puppet.events = fail, lambda: causes  # type: ignore[method-assign]
    assert str(refused(gate)) == "protective stop: speed of wrist 1; joint 4 is hot"


def test_a_connection_that_is_lost_with_the_report_is_told_with_its_place() -> None:
    puppet = Puppet()
    gate = ready(puppet)

    def lost() -> RobotState:
        raise ExecutionError("connection lost", rule="connection")

    puppet.state = lost  # type: ignore[method-assign]
    error = refused(gate)
    assert str(error) == "connection lost"
    assert error.data == {"rule": "connection", "s": 0.0123, "segment": "weld", "black_box": None}
    assert puppet.calls[-2:] == ["arc off", "stop"]


def test_a_breach_is_told_where_the_robot_has_no_word_for_its_causes() -> None:
    puppet = Puppet()
    gate = ready(puppet)

    def cut() -> tuple[Event, ...]:
        raise OSError("line cut")

    puppet.events = cut  # type: ignore[method-assign]
    error = refused(gate, START, 9.0 * ELBOW)
    assert str(error).startswith("joint speed: elbow")
    assert str(error).endswith(STOPPED)
    puppet.events = tuple  # type: ignore[method-assign]
    assert [event.text for event in gate.events()][1:] == ["no report after the stop: OSError: line cut"]


def test_a_report_between_commands_stands_in_the_black_box_once_with_the_command_before_it(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = ready(puppet, steps=1, folder=tmp_path)
    q, qd = START + 1e-5 * ELBOW, 1e-3 * ELBOW
    gate.servo(q, qd)
    # Up to the third command: one report that the gate has seen itself, and one that nobody had time for.
    between = tuple(state_at(t) for t in (0.016, 0.020))
    puppet.passed_over = lambda: tuple((state, False) for state in between)  # type: ignore[method-assign]
    gate.servo(q, STILL)
    puppet.passed_over = tuple  # type: ignore[method-assign]
    assert gate.state().t == pytest.approx(0.024)
    gate.passed_over()  # of the newest, which the gate has seen: no other row of it
    gate.stop()
    box = read_black_box(str(gate.black_box))
    np.testing.assert_allclose(box.t, [0.008, 0.016, 0.020, 0.024, 0.024], atol=1e-12)
    np.testing.assert_array_equal(box.q_cmd, [START, q, q, q, q])
    np.testing.assert_array_equal(box.qd_cmd, [STILL, qd, qd, STILL, STILL])


def test_before_the_first_command_an_arm_is_sent_where_it_is(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = ready(puppet, steps=0, folder=tmp_path)
    puppet.t = 0.008
    gate.state()
    puppet.passed_over = lambda: ((state_at(0.004), False),)  # type: ignore[method-assign]
    gate.passed_over()
    puppet.passed_over = tuple  # type: ignore[method-assign]
    gate.stop()
    box = read_black_box(str(gate.black_box))
    np.testing.assert_allclose(box.t, [0.004, 0.008, 0.008])
    np.testing.assert_array_equal(box.q_cmd, box.q_act)
    np.testing.assert_array_equal(box.qd_cmd, np.zeros((3, 6)))


def test_who_has_not_connected_has_passed_over_nothing() -> None:
    gate = SafetyGate(Puppet())
    assert gate.passed_over() == ()
    gate.state()
    assert gate.passed_over() == ()


def test_a_report_that_came_twice_is_passed_on_once() -> None:
    puppet = Puppet()
    gate = ready(puppet, steps=1)
    puppet.clock = False
    gate.servo(START, STILL)
    puppet.clock = True
    gate.servo(START, STILL)
    puppet.t += PERIOD
    gate.state()
    assert [state.t for state, _ in gate.passed_over()] == pytest.approx([0.008, 0.016])


def test_of_many_reports_passed_over_the_newest_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gate_module, "PASSED", 4)
    puppet = Puppet()
    gate = ready(puppet, steps=10)
    for first in (10, 20):  # the newest of them is the one that is shown
        gate.state()
        assert [state.t for state, _ in gate.passed_over()] == pytest.approx([PERIOD * k for k in range(first - 3, first)])
        for _ in range(10):
            gate.servo(START, STILL)
