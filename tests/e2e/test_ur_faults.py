"""UrRobot when something goes wrong in mid-weld: arc off and arm at rest in time, a reason, a log, a next connection.

How long it took is read from the controller's own clock: from the order of the fault, or the kill, to the first report of calm.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from tests.controllers import wait_for
from tests.torch_paths import START
from tests.ur_robots import controlled, place, ur_robot
from weldsim.controller.ask import ask
from weldsim.errors import ExecutionError
from weldsim.execution import ur_link
from weldsim.execution.ur_config import Series
from weldsim.execution.ur_process import ClientError, ClientProcess

AT_REST = 0.02  # [rad/s]
LIMIT, LIMIT_KILLED = 0.3, 0.5  # [s]
ATTEMPTS = 3
SLACK = 0.1  # [s] for asking, on a machine that others use too
RULE = {
    "protective-stop": "protective_stop",
    "emergency-stop": "emergency_stop",
    "foreign-program": "foreign_program",
    "link-drop": "link",
    "stall": "silence",
}


@pytest.fixture(scope="module", params=("cb3", "e"))
def controller(request: pytest.FixtureRequest) -> Iterator[tuple[Series, str]]:
    """Series and address of a controller that drops output 0, the arc, when no program runs."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled(request.param) as host:
        yield request.param, host


def state(host: str) -> dict[str, Any]:
    return ask(host, {"status": True})


def calm(now: dict[str, Any]) -> bool:
    return not now["digital_out"] & 1 and max(map(abs, now["qd"])) < AT_REST


class Owner:
    """A process that welds, and its client's number."""

    def __init__(self, process: subprocess.Popen[str], client: int) -> None:
        self.process, self.client = process, client

    def ended(self) -> dict[str, Any]:
        """What it says in the end, see `tests.ur_owner`."""
        assert self.process.stdout is not None
        lines = list(self.process.stdout)
        assert lines
        assert lines[-1].startswith("ENDED"), lines
        return json.loads(lines[-1].removeprefix("ENDED"))


@contextmanager
def welding(host: str) -> Iterator[Owner]:
    """Somebody who welds, until the block ends."""
    command = [sys.executable, "-m", "tests.ur_owner", host]
    for _ in range(ATTEMPTS):
        place(host, START)
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            patience = threading.Timer(40.0, process.kill)
            patience.start()
            try:
                line = process.stdout.readline()
                before = state(host)
                if not line.startswith("WELDING") or calm(before):
                    continue  # stopped already: this machine was held up
                assert before["digital_out"] & 1
                yield Owner(process, int(line.split()[1]))
                return
            finally:
                patience.cancel()
                process.kill()
    pytest.fail(f"no weld began in {ATTEMPTS} attempts: {line[:300]}")


def calm_after(host: str, act: Callable[[], object]) -> float:
    """Time [s] on the controller's clock until arc and arm are at rest."""
    before = state(host)["t"]
    act()
    assert wait_for(lambda: calm(state(host)), 5.0, 0.01)
    return state(host)["t"] - before


def order(host: str, fault: str, seconds: float = 0.4) -> Callable[[], object]:
    return lambda: ask(host, {"fault": fault, "seconds": seconds})


def check_end(seen: dict[str, Any], rule: str) -> None:
    """The reason is told, the arc is off, and the log has every period up to the stop."""
    assert seen["rule"] == rule, seen["text"]
    assert not seen["arc"]
    gaps = np.diff(seen["t"])
    if rule in ("link", "silence"):  # but for the time when there was nothing to be had
        gaps = np.delete(gaps, gaps.argmax())
    np.testing.assert_allclose(gaps, seen["period"], rtol=1e-6)
    assert np.abs(seen["qd"][-1]).max() < AT_REST
    assert any(seen["arc_on"])
    assert rule in {kind for _, kind, _ in seen["events"]}
    assert seen["text"] in {text for _, _, text in seen["events"]}
    assert seen["disconnect"] < 4.0


def check_next(host: str) -> None:
    """The next connection works, once a person has cleared the fault."""
    robot = ur_robot(host, START)
    with robot:
        for _ in range(round(0.2 / robot.period)):
            robot.set_arc(True)
            robot.servo(START, np.zeros(6))
        assert robot.arc
        assert robot.state().mode == "running"
    assert not robot.arc
    assert calm(state(host))


@pytest.mark.parametrize("fault", RULE)
def test_a_fault_of_the_controller(controller: tuple[Series, str], fault: str) -> None:
    _, host = controller
    with welding(host) as owner:
        if fault == "stall":  # nobody can be asked meanwhile: the controller's log says when its watchdog bit
            began = state(host)["t"]
            order(host, fault, 1.0)()
            seen = owner.ended()
            assert calm(state(host))
            bites = [t for t, text in state(host)["log"] if "watchdog" in text]
            assert bites[-1] - began < LIMIT
        else:
            assert calm_after(host, order(host, fault)) < LIMIT + SLACK
            seen = owner.ended()
    check_end(seen, RULE[fault])
    check_next(host)


@pytest.mark.parametrize(("fault", "rule"), [*list(RULE.items())[:3], ("local-control", "remote_control")])
def test_what_comes_in_the_way_of_a_connection_is_named(
    controller: tuple[Series, str], fault: str, rule: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client library knows only that its program does not take a setting, or does not start."""
    series, host = controller
    if (series, fault) == ("cb3", "local-control"):
        rule = "connection"  # there is no such switch

    class Unlucky(ClientProcess):
        def __init__(self, settings: object, answer_timeout: float) -> None:
            ask(host, {"fault": fault})

        def wait_ready(self, seconds: float) -> None:
            raise ClientError("the controller refused set_tcp")

        def close(self, seconds: float) -> bool:
            return True

    monkeypatch.setattr(ur_link, "ClientProcess", Unlucky)
    ask(host, {"fault": "recover"})
    with pytest.raises(ExecutionError) as caught:
        ur_robot(host).connect()
    assert caught.value.data["rule"] == rule
    ask(host, {"fault": "recover"})


def test_local_control_ends_a_weld_on_e_series(controller: tuple[Series, str]) -> None:
    series, host = controller
    if series == "cb3":  # knows no such switch
        with ur_robot(host) as robot:
            assert robot.facts().remote_control is None
        return
    with welding(host) as owner:
        assert calm_after(host, order(host, "local-control")) < LIMIT + SLACK
        check_end(owner.ended(), "remote_control")
    with pytest.raises(ExecutionError, match="remote control"):
        ur_robot(host).connect()
    check_next(host)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "held"])
def test_a_client_that_dies_or_hangs(controller: tuple[Series, str], how: signal.Signals) -> None:
    _, host = controller
    with welding(host) as owner:
        assert calm_after(host, lambda: os.kill(owner.client, how)) < LIMIT + SLACK
        check_end(owner.ended(), "client")
        assert not os.path.exists(f"/proc/{owner.client}")
    check_next(host)


@pytest.mark.parametrize("whole", [False, True], ids=["owner", "owner and client"])
def test_a_killed_owner(controller: tuple[Series, str], whole: bool) -> None:
    _, host = controller
    with welding(host) as owner:

        def strike() -> None:
            if whole:
                os.kill(owner.client, signal.SIGKILL)
            owner.process.kill()

        assert calm_after(host, strike) < LIMIT_KILLED + SLACK
        assert wait_for(lambda: not os.path.exists(f"/proc/{owner.client}"), 5.0)
    check_next(host)


def test_an_owner_that_stalls_is_stopped_and_told(controller: tuple[Series, str]) -> None:
    _, host = controller
    with welding(host) as owner:
        assert calm_after(host, lambda: owner.process.send_signal(signal.SIGSTOP)) < LIMIT + SLACK
        time.sleep(0.5)
        owner.process.send_signal(signal.SIGCONT)
        check_end(owner.ended(), "stall")
    check_next(host)


def test_the_arc_goes_off_where_the_controller_does_not_drop_it() -> None:
    """With an installation that keeps its outputs when a program ends, the arc is dropped by us as long as one of us lives."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled("cb3", "--low-when-stopped", "7") as host:
        for fault in ("protective-stop", "emergency-stop", "foreign-program"):
            with welding(host) as owner:
                calm_after(host, order(host, fault))
                assert not owner.ended()["arc"]
        with welding(host) as owner:
            calm_after(host, lambda: os.kill(owner.client, signal.SIGKILL))
        with welding(host) as owner:
            calm_after(host, owner.process.kill)
