"""UrRobot when something goes wrong in mid-weld: arc off and arm at rest in time, a reason, a log, a next connection.

How long it took is read from the controller's own clock: from the order of the fault, or the kill, to the first report of calm.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from tests.controllers import wait_for
from tests.torch_paths import START
from tests.ur_robots import controlled, place, ur_robot, weld
from weldsim.controller.ask import ask
from weldsim.errors import ExecutionError, InputError
from weldsim.execution.runner import execute
from weldsim.execution.ur_config import Series
from weldsim.execution.ur_robot import UrRobot

AT_REST = 0.02  # [rad/s]
SLACK = 0.1  # [s] for asking, on a machine that others use too
LIMIT = {"kill": 0.5}  # [s] any other: 0.3
RULE = {
    "protective-stop": "protective_stop",
    "emergency-stop": "emergency_stop",
    "foreign-program": "foreign_program",
    "link-drop": "link",
    "stall": "silence",
}


@pytest.fixture(scope="module", params=("cb3", "e"))
def controller(request: pytest.FixtureRequest) -> Iterator[tuple[Series, str]]:
    """Series and address of a controller whose outputs nobody drops but us, but for output 0, the arc's."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled(request.param) as host:
        yield request.param, host


def state(host: str) -> dict[str, Any]:
    return ask(host, {"status": True})


def calm(now: dict[str, Any]) -> bool:
    return not now["digital_out"] & 1 and max(map(abs, now["qd"])) < AT_REST


@dataclass
class Watch:
    """Does something to the cell once it welds, and looks at the controller until all is calm; `took` [s], None if it never is."""

    host: str
    act: Callable[[], object]
    took: float | None = None
    began: float = 0.0
    trouble: list[str] = field(default_factory=list)

    def run(self) -> None:
        if not wait_for(lambda: state(self.host)["digital_out"] & 1 and max(map(abs, state(self.host)["qd"])) > 2 * AT_REST, 15.0):
            self.trouble.append("it never welded")
            return
        before, began = state(self.host)["t"], time.monotonic()
        self.began = before
        self.act()
        while time.monotonic() - began < 5.0:
            try:
                now = state(self.host)
            except InputError:
                continue
            if calm(now):
                self.took = now["t"] - before
                return
            time.sleep(0.004)

    @contextmanager
    def looking(self) -> Iterator[None]:
        thread = threading.Thread(target=self.run)
        thread.start()
        try:
            yield
        finally:
            thread.join(30.0)
        assert not self.trouble
        assert self.took is not None


def welds_again(host: str) -> bool:
    """Whether the next connection works, once a person has cleared the fault."""
    robot = ur_robot(host, START)
    with robot:
        log = execute(robot, weld(START, robot.period, 0.4, 0.02))
    return bool(log.arc_on.any()) and not robot.arc and calm(state(host))


def until_error(robot: UrRobot, watch: Watch) -> ExecutionError:
    """The error that ends a weld of 5 s."""
    with robot, watch.looking(), pytest.raises(ExecutionError) as caught:
        execute(robot, weld(START, robot.period))
    return caught.value


@pytest.mark.parametrize("fault", RULE)
def test_a_fault_of_the_controller(controller: tuple[Series, str], fault: str) -> None:
    _, host = controller
    robot = ur_robot(host, START)
    watch = Watch(host, lambda: ask(host, {"fault": fault, "seconds": 1.0 if fault == "stall" else 0.4}))
    error = until_error(robot, watch)
    assert error.data["rule"] == RULE[fault]
    if fault == "stall":  # nobody can be asked meanwhile: the controller's log says when its watchdog bit
        bites = [t for t, text in state(host)["log"] if "watchdog" in text]
        assert bites[-1] - watch.began < 0.3
    else:
        assert watch.took is not None
        assert watch.took < 0.3 + SLACK
    check_log(error, robot, watch)
    assert not robot.arc
    assert welds_again(host)


def check_log(error: ExecutionError, robot: UrRobot, watch: Watch) -> None:
    """Every period up to the stop is there, arc and reason too."""
    log: Any = error.data["log"]
    steps = np.diff(log.t) / robot.period
    assert np.abs(steps - np.round(steps)).max() < 1e-3
    assert np.median(steps) == pytest.approx(1.0, abs=1e-6)
    assert log.arc_on.any()
    assert log.events[-1].kind == "stop"
    assert str(error.data["rule"]) in {event.kind for event in log.events}
    assert str(error) == log.events[-1].text


def test_local_control_ends_a_weld_on_e_series(controller: tuple[Series, str]) -> None:
    series, host = controller
    robot = ur_robot(host, START)
    if series == "cb3":  # knows no such switch
        with robot:
            assert robot.facts().remote_control is None
        return
    error = until_error(robot, Watch(host, lambda: ask(host, {"fault": "local-control"})))
    assert error.data["rule"] == "remote_control"
    with pytest.raises(ExecutionError, match="remote control"):
        robot.connect()
    assert welds_again(host)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_client_that_dies_or_hangs(controller: tuple[Series, str], how: signal.Signals) -> None:
    _, host = controller
    robot = ur_robot(host, START)

    def strike() -> None:
        assert robot.client_pid
        os.kill(robot.client_pid, how)

    watch = Watch(host, strike)
    error = until_error(robot, watch)
    assert error.data["rule"] == "client"
    assert watch.took is not None
    assert watch.took < 0.3 + SLACK
    check_log(error, robot, watch)
    assert welds_again(host)


@contextmanager
def owner(host: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A process that welds, and its client's number."""
    place(host, START)
    command = [sys.executable, "-m", "tests.ur_owner", host]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        patience = threading.Timer(30.0, process.kill)
        patience.start()
        try:
            line = process.stdout.readline()
            assert line.startswith("WELDING"), line
            yield process, int(line.split()[1])
        finally:
            patience.cancel()
            process.kill()


def calm_after(host: str, act: Callable[[], object]) -> float:
    """Time [s] on the controller's clock until all is calm."""
    before = state(host)["t"]
    act()
    assert wait_for(lambda: calm(state(host)), 5.0, 0.004)
    return state(host)["t"] - before


@pytest.mark.parametrize("whole", [False, True], ids=["owner", "owner and client"])
def test_a_killed_owner(controller: tuple[Series, str], whole: bool) -> None:
    _, host = controller
    with owner(host) as (process, client):

        def strike() -> None:
            if whole:
                os.kill(client, signal.SIGKILL)
            process.kill()

        assert calm_after(host, strike) < LIMIT["kill"] + SLACK
        assert wait_for(lambda: not os.path.exists(f"/proc/{client}"), 5.0)
    assert welds_again(host)


def test_an_owner_that_stalls_is_stopped_and_told(controller: tuple[Series, str]) -> None:
    _, host = controller
    with owner(host) as (process, _):
        assert calm_after(host, lambda: process.send_signal(signal.SIGSTOP)) < 0.3 + SLACK
        time.sleep(0.7)
        process.send_signal(signal.SIGCONT)
        assert process.stdout is not None
        assert any(line.startswith("ENDED stall") for line in process.stdout)
    assert welds_again(host)


def test_the_arc_goes_off_where_the_controller_does_not_drop_it() -> None:
    """With an installation that keeps its outputs when a program ends, the arc is dropped by us as long as one of us lives."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled("cb3", "--low-when-stopped", "7") as host:
        for fault in ("protective-stop", "emergency-stop", "stall"):
            robot = ur_robot(host, START)
            until_error(robot, Watch(host, lambda fault=fault: ask(host, {"fault": fault, "seconds": 0.5})))
            assert not robot.arc
            assert calm(state(host))
        robot = ur_robot(host, START)
        until_error(robot, Watch(host, lambda: os.kill(robot.client_pid or 0, signal.SIGKILL)))
        assert calm(state(host))
        with owner(host) as (process, _):
            calm_after(host, process.kill)
