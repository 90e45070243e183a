"""What every Robot does, whichever it is: one suite for all implementations."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from tests.arm_worlds import bare_model
from tests.machine import unless_held_up
from tests.torch_paths import START
from tests.ur_robots import controlled, ur_robot
from weldsim.errors import ExecutionError
from weldsim.execution.gate import SafetyGate
from weldsim.execution.robot import Robot
from weldsim.execution.simulated import SimulatedRobot
from weldsim.execution.ur_config import Series
from weldsim.kinematics import DH, torch_pose
from weldsim.mounts import PAYLOAD, X_FT
from weldsim.records import Segment

STILL = np.zeros(6)
FAST = np.array([1.0, -0.5, 0.5, 1.0, -1.0, 1.0])
SLOW = np.array([0.2, -0.1, 0.1, 0.3, -0.4, 1.0])  # no gate lets a torch pass 0.25 m/s


def simulated() -> Iterator[Callable[[], Robot]]:
    yield lambda: SimulatedRobot(bare_model(), START)


def gated() -> Iterator[Callable[[], Robot]]:
    """The simulated arm behind its gate, told that what comes is a weld: elsewhere no arc would burn."""

    def build() -> Robot:
        gate = SafetyGate(SimulatedRobot(bare_model(), START), arc=True)
        gate.label(Segment.WELD, 0.0)
        return gate

    yield build


def real(series: Series) -> Iterator[Callable[[], Robot]]:
    """Over sockets, as in the cell."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled(series) as host:
        yield lambda: ur_robot(host, START)


ROBOTS = {"simulated": simulated, "gated": gated, "ur-cb3": lambda: real("cb3"), "ur-e": lambda: real("e")}


@pytest.fixture(scope="module", params=ROBOTS)
def new_robot(request: pytest.FixtureRequest) -> Iterator[Callable[[], Robot]]:
    yield from ROBOTS[request.param]()


@pytest.fixture
def robot(new_robot: Callable[[], Robot]) -> Robot:
    return new_robot()


def test_command_before_connect_is_refused(robot: Robot) -> None:
    with pytest.raises(ExecutionError, match="connect"):
        robot.servo(START, STILL)


@unless_held_up
def test_facts_are_those_of_our_arm_and_mount(robot: Robot) -> None:
    with pytest.raises(ExecutionError, match="connect"):
        robot.facts()
    with robot:
        facts = robot.facts()
        assert (facts.model, facts.safety, facts.mode) == ("UR5", "normal", "running")
        assert facts.serial != "0", "no arm has this number: where there is none, nothing is told"
        assert not facts.program_running
        assert facts.remote_control is not False
        assert facts.X_FT is not None
        assert np.abs(facts.X_FT.matrix - X_FT.matrix).max() < 1e-6
        assert facts.payload_kg == pytest.approx(PAYLOAD)
        assert facts.dh is not None
        assert np.abs(facts.dh - DH).max() < 1e-12


@unless_held_up
def test_state_is_consistent_and_moves_with_time(robot: Robot) -> None:
    with robot:
        before = robot.state()
        assert np.abs(before.q - START).max() < 1e-3
        robot.servo(START, STILL)
        after = robot.state()
        assert np.isclose(after.t - before.t, robot.period)
        reached = torch_pose(after.q)
        assert np.abs(reached.p - after.X_BT.p).max() < 1e-5
        assert np.abs(reached.R - after.X_BT.R).max() < 1e-5


@unless_held_up
def test_servo_returns_what_was_sent_and_gets_there(robot: Robot) -> None:
    with robot:
        steps = round(0.72 / robot.period)
        for k in range(1, steps + 1):
            u = k / steps
            q = START + 0.05 * (3 * u**2 - 2 * u**3)
            qd = np.full(6, 0.05 * (6 * u - 6 * u**2) / (steps * robot.period))
            assert (robot.servo(q, qd) == q).all()
        for _ in range(round(0.16 / robot.period)):
            robot.servo(START + 0.05, STILL)
        assert np.abs(robot.state().q - START - 0.05).max() < 1e-3


@unless_held_up
def test_stop_drops_the_arc_and_rests_within_300_ms(robot: Robot) -> None:
    with robot:
        speed, q = SLOW if isinstance(robot, SafetyGate) else FAST, START
        last = round(0.32 / robot.period)
        for k in range(1, last):
            u = min(1.0, k * robot.period / 0.2)
            u = u**3 * (10 - 15 * u + 6 * u**2)
            robot.set_arc(k > last // 2)
            q = q + speed * u * robot.period
            robot.servo(q, speed * u)
        assert robot.arc
        began = robot.state().t
        robot.stop()
        assert not robot.arc
        assert robot.state().t - began <= 0.3
        assert np.abs(robot.state().qd).max() < 0.02
        where = robot.state().q
        robot.servo(where, STILL)
        assert np.abs(robot.state().q - where).max() < 1e-3


@unless_held_up
def test_leaving_the_block_drops_the_arc_even_on_an_error(robot: Robot) -> None:
    def weld_and_fail() -> None:
        with robot:
            robot.set_arc(True)
            robot.servo(START, STILL)
            raise RuntimeError("in mid-weld")

    with pytest.raises(RuntimeError, match="in mid-weld"):
        weld_and_fail()
    assert not robot.arc
    with pytest.raises(ExecutionError):
        robot.servo(START, STILL)


def test_disconnect_without_connect_is_harmless(robot: Robot) -> None:
    robot.disconnect()
    robot.disconnect()
    assert not robot.arc
