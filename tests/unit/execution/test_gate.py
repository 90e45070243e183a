"""Every rule of the gate trips on its breach, at the value it names, and on nothing less; the arc is off before the arm stops."""

import copy
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import final

import numpy as np
import pytest
from numpy import ndarray

from tests.calibrations import calibrated
from tests.torch_paths import START, flat_curve, torch_path
from weldsim.arm import UR5, Arm
from weldsim.config import load_config
from weldsim.errors import ConfigError, ExecutionError, InputError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.config import GateConfig
from weldsim.execution.gate import SafetyGate
from weldsim.execution.limits import off_the_way
from weldsim.execution.resample import at_period
from weldsim.execution.robot import Robot
from weldsim.execution.runner import execute
from weldsim.kinematics import JOINT_NAMES, torch_pose
from weldsim.motion.plan import plan_motion
from weldsim.records import Event, JointTrajectory, RobotFacts, RobotState, Segment

STILL = np.zeros(6)
PERIODS = (0.008, 0.002)


@final
class Puppet(Robot):
    """Is where it was told to be, unless a string is pulled.

    Attributes:
        calls: what was asked of it, in order.  offset: added to the joint angles it reports.  clock: whether its time runs.
        burning: what it reports of the arc, whatever it was told; None where it obeys.
    """

    def __init__(self, q: ndarray = START, period: float = 0.008) -> None:
        self.name, self.period = "puppet", period
        self.q, self.t = np.array(q), 0.0
        self.calls: list[str] = []
        self.offset, self.clock, self.deaf = np.zeros(6), True, False
        self.burning: bool | None = None
        self._arc = False

    def connect(self) -> None: ...

    def disconnect(self) -> None:
        self._arc = False

    def state(self) -> RobotState:
        q = self.q + self.offset
        return RobotState(t=self.t, q=q, qd=np.zeros(6), X_BT=torch_pose(q), mode="running")

    def facts(self) -> RobotFacts:
        return RobotFacts(model="UR5", series="simulated", version="1", serial="0")

    def servo(self, q: ndarray, qd: ndarray) -> ndarray:
        self.calls.append("servo")
        if not self.deaf:
            self.q = np.array(q)
        self.t += self.period if self.clock else 0.0
        return q

    def set_arc(self, on: bool) -> None:
        self.calls.append(f"arc {'on' if on else 'off'}")
        self._arc = on

    @property
    def arc(self) -> bool:
        return self._arc if self.burning is None else self.burning

    def stop(self) -> None:
        self.calls.append("stop")
        self._arc = False

    def events(self) -> tuple[Event, ...]:
        return ()


def gate_around(puppet: Puppet, config: GateConfig | None = None, folder: Path | None = None, arc: bool = True) -> SafetyGate:
    gate = SafetyGate(puppet, config, arc=arc, folder=folder)
    gate.connect()
    return gate


Profile = Callable[[float], tuple[float, float]]
"""Angle [rad] and speed [rad/s] at a time [s]."""


def sent(gate: SafetyGate, profile: Profile, joint: int, seconds: float) -> ExecutionError | None:
    """What came of moving one joint by a profile from where it stands."""
    h, q0 = gate.period, gate.state().q
    direction = np.eye(6)[joint]
    gate.start_from(q0)
    try:
        for k in range(1, round(seconds / h) + 1):
            angle, rate = profile(k * h)
            gate.servo(q0 + angle * direction, rate * direction)
    except ExecutionError as error:
        return error
    return None


def jerked(jerk: float, acceleration: float, speed: float) -> Profile:
    """From rest with a constant jerk up to an acceleration, with it, and back, up to a speed."""
    ramp, hold = acceleration / jerk, max(0.0, speed / acceleration - acceleration / jerk)

    def at(t: float) -> tuple[float, float]:
        q = v = a = 0.0
        for length, j in ((ramp, jerk), (hold, 0.0), (ramp, -jerk), (1e9, 0.0)):
            dt = min(t, length)
            q, v, a = q + v * dt + a * dt**2 / 2 + j * dt**3 / 6, v + a * dt + j * dt**2 / 2, a + j * dt
            t -= dt
            if t <= 0:
                break
        return q, v

    return at


# Joint 5, the last, moves the torch least; its own limits are met with the others set out of the way.
WIDE = GateConfig(joint_speed=6.0, joint_acceleration=90.0, joint_jerk=9000.0, tracking=0.5)
CASES = {
    "joint speed": (replace(WIDE, joint_speed=2.0), lambda x: jerked(300.0, 8.0, 2.0 * x), 0.8),
    "joint acceleration": (replace(WIDE, joint_acceleration=8.0), lambda x: jerked(300.0, 8.0 * x, 2.0), 0.8),
    "joint jerk": (replace(WIDE, joint_jerk=300.0), lambda x: jerked(300.0 * x, 9.0, 2.0), 0.8),
}


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("rule", CASES)
def test_a_motion_at_its_limit_passes_and_one_a_percent_over_trips(rule: str, period: float) -> None:
    config, profile, seconds = CASES[rule]
    at_limit = Puppet(period=period)
    assert sent(gate_around(at_limit, config), profile(0.999), 5, seconds) is None
    over = Puppet(period=period)
    error = sent(gate_around(over, config), profile(1.03), 5, seconds)
    assert error is not None
    assert error.data["rule"] == rule
    assert error.data["what"] == "wrist_3"
    limit = {"joint speed": 2.0, "joint acceleration": 8.0, "joint jerk": 300.0}[rule]
    assert error.data["limit"] == limit
    assert 1.0 < float(str(error.data["value"])) / limit < 1.04
    assert over.calls[-2:] == ["arc off", "stop"]


@pytest.mark.parametrize("period", PERIODS)
def test_speeds_that_are_told_count_like_angles_that_are_sent(period: float) -> None:
    gate = gate_around(Puppet(period=period))
    with pytest.raises(ExecutionError, match="joint speed: elbow"):
        gate.servo(START, 3.2 * np.eye(6)[2])
    gate = gate_around(Puppet(period=period))
    with pytest.raises(ExecutionError, match="joint acceleration: elbow"):
        gate.servo(START, 11.5 * period * np.eye(6)[2])


@pytest.mark.parametrize("joint", range(6))
def test_joint_position(joint: int) -> None:
    at = START.copy()
    at[joint] = 2 * np.pi - 0.001
    wide = replace(WIDE, box_low=(-2.0, -2.0, -2.0), box_high=(2.0, 2.0, 2.0))
    gate = gate_around(Puppet(at), wide)
    error = sent(gate, lambda t: (0.02 * t, 0.02), joint, 0.2)
    assert error is not None
    assert error.data["rule"] == "joint position"
    assert float(str(error.data["value"])) == pytest.approx(2 * np.pi, abs=2e-4)
    assert sent(gate_around(Puppet(at), wide), lambda t: (0.004 * t, 0.004), joint, 0.2) is None


@pytest.mark.parametrize("period", PERIODS)
def test_torch_speed(period: float) -> None:
    # The shoulder's pan carries the torch on a circle about the base axis.
    radius = float(np.linalg.norm(torch_pose(START).p[:2]))
    assert sent(gate_around(Puppet(period=period)), jerked(20.0, 1.0, 0.249 / radius), 0, 1.0) is None
    error = sent(gate_around(Puppet(period=period)), jerked(20.0, 1.0, 0.252 / radius), 0, 1.0)
    assert error is not None
    assert error.data["rule"] == "torch speed"
    assert 0.25 < float(str(error.data["value"])) < 0.2521


@pytest.mark.parametrize(("side", "axis"), [(side, axis) for side in ("box_low", "box_high") for axis in range(3)])
def test_workspace(side: str, axis: int) -> None:
    tip = torch_pose(START).p
    bounds = {"box_low": [-1.1, -1.1, 0.0], "box_high": [1.1, 1.1, 1.3]}
    bounds[side][axis] = tip[axis] + (-0.01 if side == "box_low" else 0.01)
    config = GateConfig(box_low=tuple(bounds["box_low"]), box_high=tuple(bounds["box_high"]), tip_speed=0.25)
    outward = -1.0 if side == "box_low" else 1.0
    # Along the direction of joint space that moves the tip outwards.
    slope = np.array([(torch_pose(START + 1e-6 * np.eye(6)[j]).p - tip)[axis] / 1e-6 for j in range(6)])
    step = outward * slope / (slope @ slope)
    for reach, stopped in ((0.009, False), (0.011, True)):
        puppet = Puppet()
        gate = gate_around(puppet, config)
        error = None
        for k in range(1, 126):
            u = k / 125
            v = u**3 * (10 - 15 * u + 6 * u**2)
            try:
                gate.servo(START + reach * v * step, reach * 30 * u**2 * (1 - u) ** 2 * step)
            except ExecutionError as caught:
                error = caught
                break
        assert (error is not None) is stopped
        if error is not None:
            assert error.data["rule"] == "workspace"
            assert error.data["what"] == f"torch tip {'xyz'[axis]}"
            assert abs(float(str(error.data["value"])) - bounds[side][axis]) < 1e-3


@pytest.mark.parametrize(("degrees", "stopped"), [(0.49, False), (0.51, True)])
def test_start(degrees: float, stopped: bool) -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    away = START + np.deg2rad(degrees) * np.eye(6)[3]
    if not stopped:
        gate.servo(away, STILL)
        return
    with pytest.raises(ExecutionError, match=r"start: wrist_1 stands 0\.51 deg") as caught:
        gate.servo(away, STILL)
    assert caught.value.data["rule"] == "start"
    assert "servo" not in puppet.calls


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize(("offset", "stopped"), [(0.019, False), (0.021, True)])
def test_tracking_of_a_joint(period: float, offset: float, stopped: bool) -> None:
    puppet = Puppet(period=period)
    gate = gate_around(puppet)
    gate.servo(START, STILL)
    puppet.offset = offset * np.eye(6)[1]
    if not stopped:
        gate.servo(START, STILL)
        return
    with pytest.raises(ExecutionError, match="tracking: shoulder_lift") as caught:
        gate.servo(START, STILL)
    assert caught.value.data["value"] == pytest.approx(offset)


@pytest.mark.parametrize(("millimetres", "stopped"), [(0.95, False), (1.05, True)])
@pytest.mark.parametrize("segment", [Segment.WELD, Segment.AIR])
def test_tracking_of_the_torch_is_for_welds(millimetres: float, stopped: bool, segment: Segment) -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.label(segment, 0.123)
    gate.servo(START, STILL)
    radius = float(np.linalg.norm(torch_pose(START).p[:2]))
    puppet.offset = millimetres * 1e-3 / radius * np.eye(6)[0]
    if not (stopped and segment == Segment.WELD):
        gate.servo(START, STILL)
        return
    with pytest.raises(ExecutionError, match=r"tracking: torch tip is 1\.05 mm off.* s = 123\.0 mm of the weld") as caught:
        gate.servo(START, STILL)
    assert caught.value.data["s"] == 0.123


def test_an_arm_that_trails_is_no_breach_and_one_that_stands_is() -> None:
    trailing = Puppet()
    gate = gate_around(trailing)
    profile, behind = jerked(15.0, 1.4, 0.3), 20
    trailing.deaf = True
    for k in range(1, 200):
        trailing.q = START + profile(max(0, k - behind) * 0.008)[0] * np.eye(6)[0]
        angle, rate = profile(k * 0.008)
        gate.servo(START + angle * np.eye(6)[0], rate * np.eye(6)[0])
    standing = Puppet()
    gate = gate_around(standing)
    standing.deaf = True
    error = sent(gate, profile, 0, 2.0)
    assert error is not None
    assert error.data["rule"] == "tracking"
    # It is found once the way has left where the arm stands, by the tolerance, as long ago as an arm may trail.
    gone = next(t for t in np.arange(0.0, 2.0, 0.008) if profile(float(t))[0] > 0.02)
    assert standing.t == pytest.approx(gone + 0.2, abs=0.03)


@pytest.mark.parametrize("period", PERIODS)
def test_stale_state(period: float) -> None:
    puppet = Puppet(period=period)
    gate = gate_around(puppet)
    for _ in range(10):
        gate.servo(START, STILL)
    puppet.clock = False
    begun = len(puppet.calls)
    with pytest.raises(ExecutionError, match=r"stale state: nothing new from the robot for 0\.1") as caught:
        wait(gate, 1.0)
    count = puppet.calls[begun:].count("servo")
    assert count * period == pytest.approx(0.1 + period, abs=1.01 * period)
    assert float(str(caught.value.data["value"])) > 0.1
    assert puppet.calls[-1] == "stop"
    # A report late by less is no breach.
    puppet = Puppet(period=period)
    gate = gate_around(puppet)
    for k in range(200):
        puppet.clock = k % round(0.09 / period) == 0
        gate.servo(START, STILL)


def wait(gate: SafetyGate, seconds: float) -> None:
    for _ in range(round(seconds / gate.period)):
        gate.servo(START, STILL)


def test_a_time_stamp_that_goes_back() -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.servo(START, STILL)
    puppet.t = -5.0
    with pytest.raises(ExecutionError, match="time stamp went back"):
        gate.servo(START, STILL)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_number_that_is_none_is_never_sent(bad: float) -> None:
    wrong = np.where(np.arange(6) == 4, bad, 0.0)
    for q, qd in ((START + wrong, STILL), (START, wrong)):
        puppet = Puppet()
        with pytest.raises(ExecutionError, match="not finite"):
            gate_around(puppet).servo(np.array(q), np.array(qd))
        assert "servo" not in puppet.calls


def test_a_report_that_is_none_stops_the_arm() -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.servo(START, STILL)
    puppet.offset = np.full(6, np.nan)
    with pytest.raises(ExecutionError, match="not finite"):
        gate.servo(START, STILL)
    assert puppet.calls[-1] == "stop"


@pytest.mark.parametrize("segment", list(Segment))
def test_the_arc_burns_in_weld_alone(segment: Segment) -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.label(segment, 0.0)
    if segment == Segment.WELD:
        gate.set_arc(True)
        gate.servo(START, STILL)
        assert puppet.arc
        return
    with pytest.raises(ExecutionError, match=f"arc: asked for in {segment.value}"):
        gate.set_arc(True)
    assert not puppet.arc
    assert "arc on" not in puppet.calls


def test_an_arc_left_on_at_the_end_of_the_weld() -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.label(Segment.WELD, 0.1)
    gate.set_arc(True)
    gate.servo(START, STILL)
    gate.label(Segment.RETRACT, 0.1)
    with pytest.raises(ExecutionError, match="arc: asked for in retract"):
        gate.servo(START, STILL)
    assert puppet.calls[-3:] == ["servo", "arc off", "stop"]


def test_the_arc_without_permission() -> None:
    puppet = Puppet()
    gate = gate_around(puppet, arc=False)
    gate.label(Segment.WELD, 0.0)
    gate.set_arc(False)
    with pytest.raises(ExecutionError, match="without permission"):
        gate.set_arc(True)
    assert "arc on" not in puppet.calls


def test_an_arc_that_does_not_go_off() -> None:
    puppet = Puppet()
    gate = gate_around(puppet)
    gate.label(Segment.WELD, 0.0)
    gate.set_arc(True)
    gate.servo(START, STILL)
    gate.set_arc(False)
    puppet.burning = True
    for _ in range(12):
        gate.servo(START, STILL)
    with pytest.raises(ExecutionError, match=r"output still on 0\.104 s"):
        gate.servo(START, STILL)


def test_a_robot_that_breaks_down_is_stopped_and_its_own_reason_kept(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = gate_around(puppet, folder=tmp_path)
    gate.servo(START, STILL)

    def fail(q: ndarray, qd: ndarray) -> ndarray:
        raise ExecutionError("protective stop", rule="protective_stop", t=1.0)

    puppet.servo = fail  # type: ignore[method-assign]
    with pytest.raises(ExecutionError, match="protective stop") as caught:
        gate.servo(START, STILL)
    assert caught.value.data["rule"] == "protective_stop"
    assert puppet.calls[-2:] == ["arc off", "stop"]
    assert read_black_box(str(caught.value.data["black_box"])).reason == "protective stop"


def test_a_defect_of_the_robots_own_code_stops_the_arm_too(tmp_path: Path) -> None:
    for name in ("servo", "state"):
        puppet = Puppet()
        gate = gate_around(puppet, folder=tmp_path)
        gate.servo(START, STILL)

        def fail(*_: object) -> None:
            raise ValueError("I/O operation on closed file")

        setattr(puppet, name, fail)
        with pytest.raises(ExecutionError, match="ValueError: I/O operation") as caught:
            gate.servo(START, STILL)
        assert caught.value.data["rule"] == "robot"
        assert puppet.calls[-2:] == ["arc off", "stop"]
        assert caught.value.data["black_box"] is not None


def test_a_stop_that_fails_is_told_and_the_black_box_written_all_the_same(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = gate_around(puppet, folder=tmp_path)
    gate.servo(START, STILL)

    def fail() -> None:
        raise ExecutionError("link lost", rule="link")

    puppet.stop = fail  # type: ignore[method-assign]
    gate.stop()
    assert [event.kind for event in gate.events()] == ["stop", "fault", "black box"]
    assert gate.black_box is not None


def test_the_black_box_keeps_the_last_seconds_and_reads_back(tmp_path: Path) -> None:
    puppet = Puppet()
    gate = gate_around(puppet, GateConfig(memory=0.4), folder=tmp_path / "boxes")
    profile = jerked(15.0, 1.0, 0.2)
    gate.label(Segment.WELD, 0.0)
    gate.set_arc(True)
    assert sent(gate, profile, 5, 1.0) is None
    angle, rate = profile(1.008)
    puppet.offset = np.deg2rad([0, 0, 3, 0, 0, 0])
    with pytest.raises(ExecutionError) as caught:
        gate.servo(START + angle * np.eye(6)[5], rate * np.eye(6)[5])
    path = caught.value.data["black_box"]
    assert path == tmp_path / "boxes" / "black_box-001.npz"
    assert str(path) in str(caught.value)
    record = read_black_box(str(path))
    assert record.reason in str(caught.value)
    assert len(record.t) == 50
    assert (record.robot, record.period) == ("puppet", 0.008)
    assert np.isclose(record.t[-2], puppet.t)
    # The last row but one is what broke the rule, the last is the arm at rest.
    assert np.abs(record.q_act - record.q_cmd)[:-2].max() == 0
    assert np.abs(record.q_act[-2] - record.q_cmd[-2]).max() == pytest.approx(np.deg2rad(3))
    assert record.arc_asked[:-1].all()
    assert not record.arc[-1]
    assert set(record.segments) == {"weld"}
    assert record.events[-1].kind == "stop"
    assert np.abs(record.position_B - torch_pose(record.q_act).p).max() < 1e-12
    gate.stop()
    assert gate.black_box == tmp_path / "boxes" / "black_box-002.npz"
    assert not [each for each in (tmp_path / "boxes").iterdir() if each.suffix != ".npz"]


@pytest.mark.parametrize("content", [b"", b"not a box", b"PK\x03\x04broken"])
def test_a_file_that_is_no_black_box(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "box.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"box\.npz"):
        read_black_box(path)
    np.savez(path, schema="another/1")
    with pytest.raises(InputError, match="no black box"):
        read_black_box(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_black_box(tmp_path / "missing.npz")


def test_a_folder_that_cannot_be_written_keeps_no_arm_moving(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    puppet = Puppet()
    gate = gate_around(puppet, folder=tmp_path / "taken")
    gate.servo(START, STILL)
    gate.stop()
    assert puppet.calls[-1] == "stop"
    assert gate.black_box is None
    assert "fault" in [event.kind for event in gate.events()]


@pytest.fixture(scope="module")
def trajectory() -> JointTrajectory:
    points = flat_curve("arc", 0.04) + np.array([0.0, -0.48, 0.06])
    return plan_motion(torch_path(points, np.array([0.0, 0.0, -1.0]), speed=0.01), START).trajectory


def changed(trajectory: JointTrajectory, row: int, **change: ndarray) -> JointTrajectory:
    """The trajectory with one row of some columns changed by so much."""
    columns = {}
    for name, delta in change.items():
        column = copy.deepcopy(np.array(getattr(trajectory, name)))
        column[row] = column[row] + delta
        columns[name] = column
    return replace(trajectory, **columns)


@pytest.mark.parametrize("where", [0.1, 0.5, 0.99])
@pytest.mark.parametrize("joint", range(6))
def test_one_bad_row_keeps_the_whole_trajectory_from_being_begun(trajectory: JointTrajectory, where: float, joint: int) -> None:
    row = round(where * (len(trajectory.t) - 1))
    for column, delta in (("q", 0.004), ("qd", 0.2)):
        puppet = Puppet()
        with pytest.raises(ExecutionError, match="nothing has moved") as caught:
            execute(gate_around(puppet), changed(trajectory, row, **{column: delta * np.eye(6)[joint]}))
        assert str(caught.value.data["rule"]).startswith(("joint", "torch"))
        assert abs(float(str(caught.value.data["t"])) - trajectory.t[row]) < 0.03
        assert "servo" not in puppet.calls


def test_a_plan_keeps_to_every_rule(trajectory: JointTrajectory) -> None:
    for period in PERIODS:
        puppet = Puppet(period=period)
        gate_around(puppet).check(at_period(trajectory, period))
        assert not puppet.calls


def test_a_gate_stands_behind_no_gate() -> None:
    with pytest.raises(ExecutionError, match="behind a gate already"):
        SafetyGate(SafetyGate(Puppet()))


@pytest.mark.parametrize(
    "setting", ["execution.gate.tip_speed=0.3", "execution.gate.box_low=[1.2, 0, 0]", "execution.gate.lag=nan"]
)
def test_a_rule_that_is_none_is_refused(setting: str) -> None:
    with pytest.raises(ConfigError, match=setting.partition("=")[0]):
        load_config(None, [setting])


def test_distance_from_a_polyline() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        way, point = rng.normal(size=(8, 6)), rng.normal(size=6)
        fine = np.concatenate([a + np.linspace(0, 1, 2000)[:, None] * (b - a) for a, b in pairwise(way)])
        nearest = np.linalg.norm(fine - point, axis=1).min()
        assert np.linalg.norm(off_the_way(point, way)) == pytest.approx(nearest, abs=1e-4)
    assert (off_the_way(np.ones(6), np.zeros((1, 6))) == 1).all()


def test_the_tip_is_judged_by_the_arms_own_kinematics() -> None:
    """Of two arms told the same angles one keeps to the box and the other leaves it, checked beforehand and as it moves."""
    arm, q1 = Arm(dh=calibrated(0.015, 2).dh), START + 0.05
    limit = float(arm.torch_tip(q1)[2] + UR5.torch_tip(q1)[2]) / 2
    lower, upper = sorted((arm, UR5), key=lambda each: float(each.torch_tip(q1)[2]))
    u = np.linspace(0.0, 1.0, 120)[:, None]
    q = START + u**3 * (10 - 15 * u + 6 * u**2) * (q1 - START)
    qd = np.gradient(q, 0.008, axis=0)
    qd[[0, -1]] = 0.0
    flat = np.zeros(len(q))
    trajectory = JointTrajectory(
        t=0.008 * np.arange(len(q)),
        q=q,
        qd=qd,
        qdd=np.zeros_like(q),
        s=flat,
        arc_on=flat > 0,
        segments=(Segment.AIR,) * len(q),
        joint_names=JOINT_NAMES,
    )
    for own, outcome in ((lower, "kept"), (upper, "workspace")):
        gate = gate_around(Puppet(), replace(GateConfig(), box_high=(1.1, 1.1, limit)))
        gate.arm = own
        assert _outcome(lambda gate=gate: gate.check(trajectory)) == outcome
        assert _outcome(lambda gate=gate: [gate.servo(*row) for row in zip(q, qd, strict=True)]) == outcome


def _outcome(act: Callable[[], object]) -> str:
    """ "kept", or which rule was broken."""
    try:
        act()
    except ExecutionError as error:
        return str(error.data["rule"])
    return "kept"
