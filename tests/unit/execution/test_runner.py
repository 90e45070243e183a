"""execute: what is sent, when the arc burns, what is refused, and what is kept when the arm stops."""

from dataclasses import replace
from typing import Any, final

import numpy as np
import pytest
from jaxtyping import TypeCheckError
from numpy import ndarray

from tests.arm_worlds import bare_model
from tests.torch_paths import START, flat_curve, torch_path
from weldsim.errors import ExecutionError, Interrupted
from weldsim.execution.config import ExecutionConfig, SimulationConfig
from weldsim.execution.gate import SafetyGate
from weldsim.execution.resample import at_period, slowed
from weldsim.execution.robot import Robot
from weldsim.execution.runner import execute
from weldsim.execution.simulated import SimulatedRobot
from weldsim.kinematics import torch_pose
from weldsim.motion.plan import plan_motion
from weldsim.records import ExecutionLog, JointTrajectory, RobotFacts, RobotState, Segment

PATH = torch_path(flat_curve("arc", 0.04) + np.array([0.0, -0.48, 0.06]), np.array([0.0, 0.0, -1.0]), speed=0.01)


@pytest.fixture(scope="module")
def trajectory() -> JointTrajectory:
    return plan_motion(PATH, START).trajectory


@final
class PerfectRobot(Robot):
    """Is at once where it is told to be; breaks down at `fail_at` commands."""

    def __init__(self, q: ndarray, period: float = 0.008, fail_at: int | None = None) -> None:
        self.name, self.period = "perfect", period
        self.q, self.qd, self.count, self.fail_at = q, np.zeros(6), 0, fail_at
        self.burned: list[bool] = []
        self.stopped = False
        self._arc = False

    def connect(self) -> None: ...

    def disconnect(self) -> None:
        self._arc = False

    def state(self) -> RobotState:
        return RobotState(t=self.count * self.period, q=self.q, qd=self.qd, X_BT=torch_pose(self.q))

    def facts(self) -> RobotFacts:
        return RobotFacts(model="UR5", series="simulated", version="1", serial="0")

    def servo(self, q: ndarray, qd: ndarray) -> ndarray:
        if self.count == self.fail_at:
            raise ExecutionError("protective stop", rule="protective_stop", t=self.count * self.period)
        self.q, self.qd, self.count = q, qd, self.count + 1
        self.burned.append(self._arc)
        return q

    def set_arc(self, on: bool) -> None:
        self._arc = on

    @property
    def arc(self) -> bool:
        return self._arc

    def stop(self) -> None:
        self._arc, self.stopped = False, True


def gated(inner: Robot, arc: bool = True) -> SafetyGate:
    """The robot behind a connected gate."""
    gate = SafetyGate(inner, arc=arc)
    gate.connect()
    return gate


def test_log_has_every_sample_and_arc_only_in_the_weld(trajectory: JointTrajectory) -> None:
    inner = PerfectRobot(START)
    robot = gated(inner)
    done: list[float] = []
    log = execute(robot, trajectory, ExecutionConfig(settle=0.1), done.append)
    k = len(trajectory.t)
    assert np.abs(log.q_cmd[:k] - trajectory.q).max() == 0
    assert np.abs(log.q_cmd[k:] - trajectory.q[-1]).max() == 0
    assert len(log.t) == k - 1 + round(0.1 / 0.008) + 1
    assert np.allclose(np.diff(log.t), 0.008)
    assert (log.s_cmd[:k] == trajectory.s).all()
    assert (log.arc_on[:k] == trajectory.arc_on).all()
    assert not log.arc_on[k:].any()
    assert inner.burned == list(log.arc_on[1:])
    assert not robot.arc
    assert log.torque is None
    assert [event.text.split()[1] for event in log.events if event.kind == "arc"] == ["on", "off"]
    segments = [event.text.split()[0] for event in log.events if event.kind == "segment"]
    assert segments == ["air", "approach", "weld", "retract", "air"]
    assert (np.diff(done) > 0).all()
    assert done[-1] <= 1.0


def test_a_start_elsewhere_moves_nothing(trajectory: JointTrajectory) -> None:
    robot = PerfectRobot(START + np.deg2rad([0, 0, 0, 0, 0.6, 0]))
    with pytest.raises(ExecutionError, match=r"wrist_2 stands 0\.60 deg") as caught:
        execute(gated(robot), trajectory)
    assert caught.value.data["rule"] == "start"
    assert robot.count == 0


def test_a_start_a_little_off_is_led_over_smoothly(trajectory: JointTrajectory) -> None:
    offset = np.deg2rad([0.4, -0.4, 0.3, 0.0, -0.45, 0.49])
    robot = PerfectRobot(START + offset)
    log = execute(gated(robot), trajectory)
    assert np.abs(log.q_cmd[0] - START - offset).max() < 1e-12
    k = len(trajectory.t)
    late = slice(round(0.5 / 0.008) + 1, k)
    assert np.abs(log.q_cmd[late] - trajectory.q[late]).max() < 1e-12
    assert np.abs(np.diff(log.q_cmd[:k], axis=0) / 0.008 - np.diff(trajectory.q, axis=0) / 0.008).max() < 0.05


def test_without_permission_the_same_motion_burns_nothing(trajectory: JointTrajectory) -> None:
    robot = PerfectRobot(START)
    log = execute(gated(robot, arc=False), trajectory)
    assert np.abs(log.q_cmd[: len(trajectory.t)] - trajectory.q).max() == 0
    assert not log.arc_on.any()
    assert not any(robot.burned)


def test_a_robot_without_its_gate_is_not_moved(trajectory: JointTrajectory) -> None:
    robot = PerfectRobot(START)
    run: Any = execute  # as code that nobody has type-checked would call it
    with pytest.raises((ExecutionError, TypeCheckError)):
        run(robot, trajectory)
    assert robot.count == 0


def test_an_interrupt_stops_the_arm(trajectory: JointTrajectory) -> None:
    robot = PerfectRobot(START)

    def interrupt(done: float) -> None:
        if done > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"arm was stopped; it was at s = [\d.]+ mm of the weld$") as caught:
        execute(gated(robot), trajectory, None, interrupt)
    assert robot.stopped
    assert not robot.arc
    log = caught.value.log
    assert isinstance(log, ExecutionLog)
    assert 0.4 < len(log.t) / len(trajectory.t) < 0.7


def test_arc_outside_the_weld_moves_nothing(trajectory: JointTrajectory) -> None:
    arc = np.array(trajectory.arc_on)
    arc[3] = True
    robot = PerfectRobot(START)
    with pytest.raises(ExecutionError, match="in air"):
        execute(gated(robot), replace(trajectory, arc_on=arc))
    assert robot.count == 0


def test_a_stop_keeps_the_log_and_drops_the_arc(trajectory: JointTrajectory) -> None:
    at = int(np.flatnonzero(trajectory.arc_on)[20])
    robot = PerfectRobot(START, fail_at=at)
    with pytest.raises(ExecutionError, match="protective stop") as caught:
        execute(gated(robot), trajectory)
    log = caught.value.data["log"]
    assert isinstance(log, ExecutionLog)
    assert len(log.t) == at + 1
    assert log.events[-1].kind == "stop"
    assert robot.stopped
    assert not robot.arc


@pytest.mark.parametrize("period", [0.002, 0.004, 0.012, 0.016])
def test_other_periods_pass_the_same_points(trajectory: JointTrajectory, period: float) -> None:
    other = at_period(trajectory, period)
    assert np.allclose(np.diff(other.t), period)
    assert other.t[-1] >= trajectory.t[-1] - 1e-9
    assert np.allclose(other.q[-1], trajectory.q[-1])
    weld = np.array([segment == Segment.WELD for segment in other.segments])
    assert (other.arc_on == weld).all()
    for column, ours in zip(trajectory.q.T, other.q.T, strict=True):
        assert np.abs(np.interp(other.t, trajectory.t, column) - ours).max() < 3e-5
    speed, acceleration = np.gradient(other.q, period, axis=0), np.gradient(other.qd, period, axis=0)
    assert np.abs(speed - other.qd)[2:-2].max() < 350 * period**2
    assert np.abs(acceleration - other.qdd)[2:-2].max() < 350 * period


@pytest.mark.parametrize("scale", [1.0, 0.5, 0.1, 0.013])
def test_slowed_is_the_same_motion_in_more_time(trajectory: JointTrajectory, scale: float) -> None:
    slow = at_period(slowed(trajectory, scale), 0.008)
    assert slow.t[-1] == pytest.approx(trajectory.t[-1] / scale, abs=0.008 / scale)
    assert np.abs(slow.qd).max() <= np.abs(trajectory.qd).max() * scale * 1.001
    assert np.abs(slow.qdd).max() <= np.abs(trajectory.qdd).max() * scale**2 * 1.01
    for column, ours in zip(trajectory.q.T, slow.q.T, strict=True):
        assert np.abs(np.interp(np.minimum(slow.t * scale, trajectory.t[-1]), trajectory.t, column) - ours).max() < 3e-5


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.01, 1e-9, float("nan"), float("inf")])
def test_no_motion_is_made_faster_or_endless(trajectory: JointTrajectory, scale: float) -> None:
    with pytest.raises(ExecutionError, match="speed scale"):
        slowed(trajectory, scale)
    assert at_period(trajectory, 0.008) is trajectory


def test_e_series_rate_in_the_twin(trajectory: JointTrajectory) -> None:
    robot = SimulatedRobot(bare_model(), START, SimulationConfig(period=0.002))
    with gated(robot) as gate:
        log = execute(gate, trajectory)
    assert log.period == 0.002
    plan = plan_motion(PATH, START)
    distance = np.linalg.norm(log.X_BT_act.p[log.arc_on] - plan.rail.at(log.s_cmd[log.arc_on]).p, axis=1)
    assert np.percentile(distance, 95) <= 0.3e-3
