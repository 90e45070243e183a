"""What the gate tells: each breach word by word with its data, the events of a stop, and reports that it alone has looked at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.torch_paths import START
from tests.unit.execution.test_gate import Puppet
from weldsim.errors import ExecutionError, RecordError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.config import GateConfig
from weldsim.execution.gate import PASSED, SafetyGate
from weldsim.kinematics import JOINT_NAMES, torch_pose
from weldsim.records import Event, JointTrajectory, RobotState, Segment

STILL, ELBOW, PERIOD = np.zeros(6), np.eye(6)[2], 0.008
STOPPED = "; the arc is off and the arm was stopped"


def ready(puppet: Puppet, segment: Segment = Segment.WELD, steps: int = 5, **more) -> SafetyGate:
    """A gate around it after some commands to stay, 12.3 mm along a segment."""
    gate = SafetyGate(puppet, more.pop("config", None), arc=more.pop("arc", True), **more)
    gate.connect()
    gate.label(segment, 0.0123)
    for _ in range(steps):
        gate.servo(START, STILL)
    return gate


def refused(gate: SafetyGate, q: ndarray = START, qd: ndarray = STILL) -> ExecutionError:
    with pytest.raises(ExecutionError) as caught:
        gate.servo(q, qd)
    return caught.value


def test_a_joint_off_its_way_is_told_with_all_its_figures() -> None:
    puppet = Puppet()
    gate = ready(puppet, Segment.AIR)
    puppet.offset = 0.03 * ELBOW
    error = refused(gate)
    assert str(error) == f"tracking: elbow is 1.72 deg off (limit 1.15 deg) at 0.048 s, s = 12.3 mm of the air{STOPPED}"
    assert error.data == {
        "rule": "tracking",
        "what": "elbow",
        "value": pytest.approx(0.03),
        "limit": GateConfig().tracking,
        "t": pytest.approx(6 * PERIOD),
        "s": 0.0123,
        "segment": "air",
        "black_box": None,
    }


def test_a_torch_off_its_weld_is_told_with_all_its_figures() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    radius = float(np.linalg.norm(torch_pose(START).p[:2]))
    puppet.offset = 1.2e-3 / radius * np.eye(6)[0]
    error = refused(gate)
    assert str(error).startswith("tracking: torch tip is 1.20 mm off the weld (limit 1.00 mm) at 0.048 s, s = 12.3 mm of the weld")
    assert (error.data["what"], error.data["limit"]) == ("torch tip", GateConfig().tracking_tip)
    assert error.data["value"] == pytest.approx(1.2e-3, rel=1e-3)


@pytest.mark.parametrize("joint", [0, 4])
def test_a_number_that_is_none_names_its_joint(joint: int) -> None:
    bad = np.where(np.arange(6) == joint, np.nan, 0.0)
    for q, qd in ((START + bad, STILL), (START, bad)):
        error = refused(ready(Puppet(), steps=1), q, qd)
        name = JOINT_NAMES[joint]
        assert str(error).startswith(f"command: {name} is told a number that is not finite at 0.008 s")
        assert (error.data["rule"], error.data["what"], error.data["limit"]) == ("command", name, 0.0)
        assert np.isnan(float(str(error.data["value"])))


def test_a_stamp_that_goes_back_and_one_that_stands_are_told() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    puppet.t = -1.0
    error = refused(gate)
    assert str(error).startswith("stale state: time stamp went back from 0.040 to -0.992 s at 0.040 s")
    assert (error.data["what"], error.data["value"], error.data["limit"]) == (
        "time stamp",
        pytest.approx(-0.992),
        pytest.approx(0.04),
    )
    puppet = Puppet()
    gate = ready(puppet)
    puppet.clock = False
    for _ in range(12):  # 0.096 s; the limit is 0.1 s
        gate.servo(START, STILL)
    error = refused(gate)
    assert str(error).startswith("stale state: nothing new from the robot for 0.104 s (limit 0.1 s) at 0.040 s")
    assert (error.data["what"], error.data["value"], error.data["limit"]) == ("time stamp", pytest.approx(0.104), 0.1)


def test_what_is_as_old_or_as_late_as_it_may_be_is_no_breach() -> None:
    """Ten periods of 8 ms are 80 ms, which the limits are set to."""
    for name in ("stale", "arc_lag"):
        puppet = Puppet()
        gate = ready(puppet, config=replace(GateConfig(), **{name: 10 * PERIOD}))
        if name == "stale":
            puppet.clock = False
        else:
            gate.set_arc(True)
            gate.servo(START, STILL)
            gate.set_arc(False)
            puppet.burning = True
        for _ in range(10):
            gate.servo(START, STILL)
        assert refused(gate).data["value"] == pytest.approx(11 * PERIOD)


def test_a_count_of_what_is_late_begins_anew_when_it_is_well() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    for k in range(60):
        puppet.clock = k % 12 == 0
        puppet.burning = k % 12 != 0
        gate.servo(START, STILL)


def test_an_arc_that_stays_on_is_told_with_all_its_figures() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    gate.set_arc(True)
    puppet.burning = True
    gate.set_arc(False)
    for _ in range(12):
        gate.servo(START, STILL)
    error = refused(gate)
    assert str(error).startswith("arc: output still on 0.104 s after it was told to go off (limit 0.1 s) at 0.144 s")
    assert (error.data["rule"], error.data["what"], error.data["value"]) == ("arc", "arc output", pytest.approx(0.104))
    assert error.data["limit"] == 0.1


@pytest.mark.parametrize("permitted", [True, False])
def test_an_arc_that_may_not_burn_is_told(permitted: bool) -> None:
    gate = ready(Puppet(), Segment.APPROACH, arc=permitted)
    with pytest.raises(ExecutionError) as caught:
        gate.set_arc(True)
    why = "asked for in approach; it may burn in weld alone" if permitted else "asked for without permission (--arc)"
    assert str(caught.value) == f"arc: {why} at 0.040 s, s = 12.3 mm of the approach{STOPPED}"
    assert {name: caught.value.data[name] for name in ("rule", "what", "value", "limit")} == {
        "rule": "arc",
        "what": "arc",
        "value": 1.0,
        "limit": 0.0,
    }
    assert gate.inner.calls[-2:] == ["arc off", "stop"]  # type: ignore[attr-defined]


def test_a_start_elsewhere_is_told_in_motion_and_beforehand() -> None:
    away = START + 0.01 * np.eye(6)[1]
    gate = ready(Puppet(), steps=0)
    error = refused(gate, away)
    told = "shoulder_lift stands 0.57 deg from the trajectory's first point (limit 0.11 deg); plan again from where the arm is"
    limit = GateConfig().start_tolerance
    assert str(error).startswith(f"start: {told} at 0.000 s".replace("0.11", f"{np.rad2deg(limit):.2f}"))
    assert (error.data["what"], error.data["value"], error.data["limit"]) == ("shoulder_lift", pytest.approx(0.01), limit)
    puppet = Puppet()
    puppet.t = 3.0
    gate = ready(puppet, steps=0)
    with pytest.raises(ExecutionError) as caught:
        gate.check(still(away))
    assert str(caught.value) == f"start: {told}".replace("0.11", f"{np.rad2deg(limit):.2f}")
    assert caught.value.data == {"rule": "start", "what": "shoulder_lift", "value": pytest.approx(0.01), "limit": limit, "t": 3.0}
    assert puppet.calls == []


def still(q: ndarray, n: int = 20, arc_on: ndarray | None = None, segment: Segment = Segment.AIR) -> JointTrajectory:
    """At rest for n periods, 1 mm of arc length each."""
    rest = np.zeros((n, 6))
    return JointTrajectory(
        t=PERIOD * np.arange(n),
        q=np.tile(q, (n, 1)),
        qd=rest,
        qdd=rest,
        s=1e-3 * np.arange(n),
        arc_on=np.zeros(n, bool) if arc_on is None else arc_on,
        segments=(segment,) * n,
        joint_names=JOINT_NAMES,
    )


def test_an_arc_planned_elsewhere_is_told_beforehand() -> None:
    gate = ready(Puppet(), steps=0)
    with pytest.raises(ExecutionError) as caught:
        gate.check(still(START, arc_on=np.isin(np.arange(20), (5, 9)), segment=Segment.RETRACT))
    assert str(caught.value) == "trajectory: the arc is on at 0.040 s, in retract; it may burn in weld alone"
    assert caught.value.data == {"rule": "arc", "t": pytest.approx(0.04), "s": pytest.approx(0.005)}
    gate.check(still(START, arc_on=np.arange(20) == 5, segment=Segment.WELD))
    assert gate.inner.calls == []  # type: ignore[attr-defined]


@pytest.mark.parametrize("row", [0, 7, 19])
def test_a_motion_that_may_not_be_is_told_beforehand_with_its_instant(row: int) -> None:
    """A speed out of nothing, in the first row and the last too: it would begin and end at rest."""
    plan = still(START)
    qd = plan.qd.copy()
    qd[row] = 3.5 * ELBOW
    with pytest.raises(ExecutionError) as caught:
        ready(Puppet(), steps=0).check(replace(plan, qd=qd))
    t, s = PERIOD * row, 1e-3 * row
    assert str(caught.value).startswith("trajectory: joint speed: elbow")
    assert str(caught.value).endswith(
        f" at {t:.3f} s, s = {1e3 * s:.1f} mm of the air; nothing has moved, plan it slower or elsewhere"
    )
    assert {name: caught.value.data[name] for name in ("rule", "what", "value", "t", "s")} == {
        "rule": "joint speed",
        "what": "elbow",
        "value": pytest.approx(3.5),
        "t": pytest.approx(t),
        "s": pytest.approx(s),
    }
    assert caught.value.data["limit"] == GateConfig().joint_speed


def test_a_trajectory_that_does_not_end_at_rest_is_told_at_its_last_instant() -> None:
    """The stop that comes after it is a jerk."""
    plan = still(START)
    u = np.arange(20)[:, None] * PERIOD
    moving = replace(plan, q=START + 0.5 * 1.0 * u**2 * ELBOW, qd=1.0 * u * ELBOW)
    config = replace(GateConfig(), joint_acceleration=5.0, joint_jerk=1e4)
    with pytest.raises(ExecutionError, match=r"^trajectory: joint acceleration: elbow") as caught:
        ready(Puppet(), steps=0, config=config).check(moving)
    assert caught.value.data["t"] == pytest.approx(19 * PERIOD)
    assert caught.value.data["s"] == pytest.approx(0.019)


def test_who_commands_before_connecting_is_told() -> None:
    gate = SafetyGate(Puppet())
    with pytest.raises(ExecutionError, match=r"^puppet: commanded before connect\(\)$") as caught:
        gate.servo(START, STILL)
    assert caught.value.data == {"rule": "connection"}
    gate.connect()
    gate.servo(START, STILL)
    gate.disconnect()
    with pytest.raises(ExecutionError, match="before connect"):
        gate.servo(START, STILL)
    with pytest.raises(ExecutionError, match=r"^puppet: stands behind a gate already$") as caught:
        SafetyGate(gate)
    assert caught.value.data == {"rule": "gate"}


def test_a_robots_own_stop_is_told_with_its_place_unless_it_knows_better(tmp_path: Path) -> None:
    for own in ({}, {"s": 0.5, "segment": "elsewhere"}):
        puppet = Puppet()
        gate = ready(puppet, folder=tmp_path)

        def fail(*_: object, own: dict[str, object] = own) -> ndarray:
            raise ExecutionError("protective stop", rule="robot", **own)

        puppet.servo = fail  # type: ignore[method-assign]
        error = refused(gate)
        assert str(error) == "protective stop"
        assert error.data == {"rule": "robot", "s": 0.0123, "segment": "weld", "black_box": gate.black_box, **own}
        assert gate.black_box is not None


def test_a_defect_and_a_report_that_is_none_are_told() -> None:
    puppet = Puppet()
    gate = ready(puppet)
    puppet.servo = lambda *_: 1 / 0  # type: ignore[method-assign,assignment]
    error = refused(gate)
    assert str(error) == f"puppet: ZeroDivisionError: division by zero{STOPPED}"
    assert error.data == {"rule": "robot", "s": 0.0123, "segment": "weld", "black_box": None}
    puppet = Puppet()
    gate = ready(puppet)

    def no_report() -> RobotState:
        raise RecordError("RobotState.q: 1 value is not finite")

    puppet.state = no_report  # type: ignore[method-assign]
    error = refused(gate)
    assert str(error).startswith("stale state: RobotState.q: 1 value is not finite at 0.040 s")
    assert (error.data["rule"], error.data["what"], error.data["limit"]) == ("stale state", "report", 0.0)
    kinds = [(event.kind, event.text) for event in gate.events()]
    assert kinds[1] == ("fault", "no report after the stop: RecordError: RobotState.q: 1 value is not finite")


def test_the_events_of_a_stop_are_told_once_and_kept_in_the_black_box(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = ready(puppet, folder=tmp_path)
    puppet.events = lambda: (Event(t=0.02, kind="own", text="something"),)  # type: ignore[method-assign]
    gate.servo(START, STILL)
    assert [event.kind for event in gate.events()] == ["own", "own"]
    puppet.events = lambda: ()  # type: ignore[method-assign]

    def burnt(on: bool) -> None:
        raise OSError("no relay")

    def stuck() -> None:
        raise ValueError("no brake")

    puppet.set_arc, puppet.stop = burnt, stuck  # type: ignore[method-assign]
    gate.stop()
    events = gate.events()
    assert [(event.t, event.kind, event.text) for event in events] == [
        (pytest.approx(0.048), "stop", "stopped on request"),
        (pytest.approx(0.048), "fault", "arc off: OSError: no relay"),
        (pytest.approx(0.048), "fault", "stop: ValueError: no brake"),
        (pytest.approx(0.048), "black box", f"written to {gate.black_box}"),
    ]
    assert gate.events() == ()
    box = read_black_box(str(gate.black_box))
    assert box.reason == "stopped on request"
    assert [event.kind for event in box.events] == ["own", "own", "stop", "fault", "fault"]
    assert (box.robot, box.period) == ("puppet", PERIOD)
    np.testing.assert_allclose(box.s, 0.0123)
    assert len(box.t) == 7, "six commands, and the arm at rest"


def test_a_breach_names_its_black_box_and_its_causes(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = ready(puppet, folder=tmp_path)
    told = (
        Event(t=0.0, kind="cause", text="a cause"),
        Event(t=0.0, kind="unseen", text="not seen"),
        Event(t=0.0, kind="x", text="y"),
    )
    puppet.events = lambda: told  # type: ignore[method-assign]
    error = refused(gate, START, 9.0 * ELBOW)
    assert str(error).endswith(f"{STOPPED}; a cause; not seen; black box: {gate.black_box}")
    assert error.data["black_box"] == gate.black_box
    assert read_black_box(str(gate.black_box)).reason == str(error).partition("; a cause")[0]


def test_before_anything_is_reported_a_stop_is_at_nought() -> None:
    gate = SafetyGate(Puppet(), arc=False)
    gate.connect()
    gate.label(Segment.WELD, 0.0)
    with pytest.raises(ExecutionError, match=r"at 0\.000 s") as caught:
        gate.set_arc(True)
    assert caught.value.data["t"] == 0.0
    assert gate.events()[0].t == 0.0


def state_at(t: float) -> RobotState:
    return RobotState(t=t, q=START, qd=STILL, X_BT=torch_pose(START), mode="running")


def test_reports_that_the_gate_alone_has_seen_are_passed_on_in_order_and_once() -> None:
    puppet = Puppet()
    gate = ready(puppet, steps=0)
    assert gate.passed_over() == (), "nothing was looked at"
    for _ in range(3):
        gate.servo(START, STILL)
    late = gate.state()
    assert late.t == pytest.approx(0.024)
    passed = gate.passed_over()
    assert [state.t for state, _ in passed] == pytest.approx([0.008, 0.016])
    assert gate.passed_over() == ()
    # The robot's own, from between: in order with the gate's, those already seen left out.
    puppet.passed_over = lambda: tuple((state_at(t), True) for t in (0.020, 0.026, 0.030))  # type: ignore[method-assign]
    puppet.t = 0.032
    gate.state()
    passed = gate.passed_over()
    assert [(state.t, arc) for state, arc in passed] == [(0.026, True), (0.030, True)]
    puppet.passed_over = tuple  # type: ignore[method-assign]
    gate.servo(START, STILL)
    gate.servo(START, STILL)
    assert gate.passed_over() == (), "newer than what the caller has looked at"
    puppet.t += 0.008
    gate.state()
    assert [state.t for state, _ in gate.passed_over()] == pytest.approx([0.040, 0.048])
    gate.connect()
    assert gate.passed_over() == ()
    assert PASSED * 0.002 == 8.0


def test_a_period_learnt_while_connecting_is_the_gates(tmp_path: Path) -> None:
    class Late(Puppet):  # type: ignore[misc]
        def connect(self) -> None:
            self.period = 0.002

    gate = SafetyGate(Late(), folder=tmp_path)
    assert gate.period == 0.008
    gate.connect()
    assert gate.period == 0.002
    gate.servo(START, STILL)
    gate.stop()
    assert read_black_box(str(gate.black_box)).period == 0.002


def test_what_the_robot_says_of_itself_is_passed_through() -> None:
    puppet = Puppet()
    with SafetyGate(puppet) as gate:
        assert gate.name == "puppet"
        assert gate.facts().model == "UR5"
        assert gate.torque() is None
        puppet.torque = lambda: np.arange(6.0)  # type: ignore[method-assign]
        np.testing.assert_array_equal(gate.torque(), np.arange(6.0))
        assert gate.arc is False
        puppet.burning = True
        assert gate.arc is True
        assert gate.servo(START, STILL) is START
        np.testing.assert_array_equal(gate.state().q, START)
