"""Random motions through the gate: each rule trips at the first command past its limit and at no other, and nothing goes unseen."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import final

import numpy as np
import pytest
from numpy import ndarray

from tests.arm_worlds import bare_model
from tests.torch_paths import START
from weldsim.errors import ExecutionError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.config import ExecutionConfig, GateConfig, SimulationConfig
from weldsim.execution.gate import SafetyGate
from weldsim.execution.robot import Robot
from weldsim.execution.runner import execute
from weldsim.execution.simulated import SimulatedRobot
from weldsim.kinematics import JOINT_NAMES, torch_pose, torch_tip
from weldsim.records import Event, ExecutionLog, JointTrajectory, RobotFacts, RobotState, Segment

OPEN = GateConfig(joint_speed=6.28, joint_acceleration=100.0, joint_jerk=1e4)
PERIODS = (0.008, 0.002)


@final
class OwnPace(Robot):
    """An arm that keeps its own time: who looks is late now and then, and it goes on reporting while it stops."""

    def __init__(self, period: float, seed: int = 0, fail_at: int | None = None) -> None:
        self.name, self.period = "own pace", period
        self.q, self.k, self.sent, self.fail_at = np.array(START), 0, 0, fail_at
        self._random = np.random.default_rng(seed) if seed else None
        self._arc = False
        self._taken: list[tuple[RobotState, bool]] = []
        self._go_on(1)

    def _go_on(self, periods: int) -> None:
        for _ in range(periods):
            self.k += 1
            state = RobotState(t=self.k * self.period, q=self.q, qd=np.zeros(6), X_BT=torch_pose(self.q), mode="running")
            self._taken.append((state, self._arc))
            self._last = state

    def connect(self) -> None: ...

    def disconnect(self) -> None:
        self._arc = False

    def state(self) -> RobotState:
        if self._random is not None:
            self._go_on(int(self._random.choice([0, 0, 0, 0, 1, 3])))
        return self._last

    def passed_over(self) -> tuple[tuple[RobotState, bool], ...]:
        passed, self._taken = tuple(self._taken[:-1]), []
        return passed

    def facts(self) -> RobotFacts:
        return RobotFacts(model="UR5", series="simulated", version="1", serial="0")

    def servo(self, q: ndarray, qd: ndarray) -> ndarray:
        if self.sent == self.fail_at:
            raise ExecutionError("protective stop", rule="protective_stop", t=self.k * self.period)
        self.q, self.sent = np.array(q), self.sent + 1
        self._go_on(1)
        return q

    def set_arc(self, on: bool) -> None:
        self._arc = on

    @property
    def arc(self) -> bool:
        return self._arc

    def stop(self) -> None:
        self._arc = False
        self._go_on(20)

    def events(self) -> tuple[Event, ...]:
        return ()


def motion(seed: int, period: float, seconds: float = 0.48) -> JointTrajectory:
    """All joints from rest and back to it, with two random harmonics under a smooth window."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, period)
    u = np.pi * t / seconds
    window, slope = np.sin(u) ** 4, 4 * np.pi / seconds * np.sin(u) ** 3 * np.cos(u)
    size, phase = random.uniform(-0.02, 0.02, (2, 6)), random.uniform(0, 2 * np.pi, (2, 6))
    angle = t[:, None, None] * np.array([3.0, 7.0])[:, None] + phase
    wave, rate = (size * np.sin(angle)).sum(1), (size * np.array([3.0, 7.0])[:, None] * np.cos(angle)).sum(1)
    return JointTrajectory(
        t=t,
        q=START + window[:, None] * wave,
        qd=slope[:, None] * wave + window[:, None] * rate,
        qdd=np.zeros((len(t), 6)),
        s=0.01 * t,
        arc_on=np.zeros(len(t), bool),
        segments=(Segment.AIR,) * len(t),
        joint_names=JOINT_NAMES,
    )


def figures(move: JointTrajectory, period: float) -> dict[str, ndarray]:
    """What each rule looks at, a value a command, the arm resting at the first point before it."""
    q = np.concatenate([np.repeat(move.q[:1], 3, axis=0), move.q])
    qd = np.concatenate([np.zeros((3, 6)), move.qd])
    worst = {}
    for name, order in (("joint speed", 1), ("joint acceleration", 2), ("joint jerk", 3)):
        sent = np.abs(np.diff(q, n=order, axis=0) / period**order).max(axis=1)[-len(move.t) :]
        told = np.abs(np.diff(qd, n=order - 1, axis=0) / period ** (order - 1)).max(axis=1)[-len(move.t) :]
        worst[name] = np.maximum(sent, told)
    worst["torch speed"] = np.linalg.norm(np.diff(torch_tip(q), axis=0), axis=1)[-len(move.t) :] / period
    return worst


def first_stop(gate: SafetyGate, move: JointTrajectory) -> tuple[int, ExecutionError] | None:
    """Number of the first command that was stopped, and the error."""
    gate.start_from(move.q[0])
    for k in range(len(move.t)):
        try:
            gate.servo(move.q[k], move.qd[k])
        except ExecutionError as error:
            return k, error
    return None


LIMITS = {
    "joint speed": "joint_speed",
    "joint acceleration": "joint_acceleration",
    "joint jerk": "joint_jerk",
    "torch speed": "tip_speed",
}


@pytest.mark.parametrize(("period", "seed"), [(0.008, 1), (0.008, 2), (0.002, 3)])
@pytest.mark.parametrize("rule", LIMITS)
def test_a_rule_trips_at_the_first_command_past_its_limit(rule: str, period: float, seed: int) -> None:
    move = motion(seed, period, 0.4 if period > 0.005 else 0.2)
    values = figures(move, period)[rule]
    for limit in (values.max() * 1.0001, values.max() * 0.9999):
        config = replace(OPEN, **{LIMITS[rule]: float(limit)})
        robot = OwnPace(period)
        gate = SafetyGate(robot, config)
        gate.connect()
        stopped = first_stop(gate, move)
        over = np.flatnonzero(values > limit)
        if not len(over):
            assert stopped is None
            gate.check(replace(move, q=move.q - move.q[0] + robot.q))
            continue
        assert stopped is not None
        assert stopped[0] == over[0] == robot.sent
        assert stopped[1].data["rule"] == rule
        assert stopped[1].data["value"] == pytest.approx(values[over[0]], rel=1e-6)
        robot.q = np.array(move.q[0])
        robot._go_on(1)
        with pytest.raises(ExecutionError, match=f"trajectory: {rule}") as caught:
            gate.check(move)
        assert caught.value.data["t"] == pytest.approx(move.t[over[0]])


@pytest.mark.parametrize("period", PERIODS)
def test_after_a_stop_every_motion_begins_at_rest_and_where_the_arm_is(period: float) -> None:
    move, robot = motion(3, period), OwnPace(period)
    gate = SafetyGate(robot, OPEN)
    gate.connect()
    half = len(move.t) // 2
    for k in range(half):
        gate.servo(move.q[k], move.qd[k])
    gate.stop()
    sent = robot.sent
    with pytest.raises(ExecutionError, match="start"):
        gate.servo(robot.q + 0.01, np.zeros(6))
    # What would have gone on smoothly is a jerk from rest.
    gate.config = GateConfig()
    gate.start_from(robot.q)
    with pytest.raises(ExecutionError) as caught:
        gate.servo(move.q[half], move.qd[half] + 0.05)
    assert caught.value.data["rule"] in ("joint acceleration", "joint jerk")
    assert robot.sent == sent
    gate.servo(robot.q, np.zeros(6))


def stopped_logs(period: float) -> Iterator[tuple[OwnPace, int]]:
    for seed in (1, 2):
        yield OwnPace(period, seed, fail_at=20 * seed), seed


@pytest.mark.parametrize("period", PERIODS)
def test_log_and_black_box_hold_every_report_down_to_rest(period: float, tmp_path: Path) -> None:
    for robot, seed in stopped_logs(period):
        gate = SafetyGate(robot, folder=tmp_path)
        gate.connect()
        with pytest.raises(ExecutionError, match="protective stop") as caught:
            execute(gate, motion(seed, period), ExecutionConfig(blend=0.01))
        log, box = caught.value.data["log"], read_black_box(str(gate.black_box))
        assert isinstance(log, ExecutionLog)
        for t in (log.t, np.unique(box.t)):
            np.testing.assert_allclose(np.diff(t), period, rtol=1e-6)
            assert t[-1] >= (robot.k - 8) * period
        assert len(log.t) >= robot.sent + 20


def test_the_log_of_the_simulated_arm_goes_down_to_rest(tmp_path: Path) -> None:
    robot = SimulatedRobot(bare_model(), START, SimulationConfig(period=0.008))
    move = motion(4, 0.008, 2.0)
    with SafetyGate(robot, replace(GateConfig(), tip_speed=0.02), folder=tmp_path) as gate:
        gate.check = lambda trajectory: None  # type: ignore[method-assign] - the breach is to come in motion
        with pytest.raises(ExecutionError, match="torch speed") as caught:
            execute(gate, move, ExecutionConfig(blend=0.01))
    log, box = caught.value.data["log"], read_black_box(str(gate.black_box))
    assert isinstance(log, ExecutionLog)
    assert np.abs(log.qd_act).max() > 0.02
    for t, speed in ((log.t, log.qd_act), (box.t, box.qd_act)):
        np.testing.assert_allclose(np.diff(np.unique(t)), 0.008, rtol=1e-6)
        assert np.abs(speed[-1]).max() < 2e-3


def test_what_a_robot_finds_out_while_it_stops_is_told() -> None:
    robot = OwnPace(0.008)
    gate = SafetyGate(robot)
    gate.connect()
    gate.servo(START, np.zeros(6))
    robot.events = lambda: (Event(t=0.0, kind="cause", text="another program runs"),)  # type: ignore[method-assign]
    with pytest.raises(ExecutionError, match=r"joint speed.*the arm was stopped; another program runs"):
        gate.servo(START + 1.0, np.zeros(6))
    robot = OwnPace(0.008, fail_at=1)
    gate = SafetyGate(robot)
    gate.connect()
    gate.servo(START, np.zeros(6))
    robot.events = lambda: (Event(t=0.0, kind="unseen", text="rest was not seen"),)  # type: ignore[method-assign]
    with pytest.raises(ExecutionError, match="protective stop; rest was not seen"):
        gate.servo(START, np.zeros(6))


def test_the_torch_tip_is_that_of_the_torch_pose() -> None:
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (4, 50, 6))
    assert np.abs(torch_tip(q) - torch_pose(q).p).max() < 1e-12
