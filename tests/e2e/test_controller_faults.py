"""What goes wrong in mid-weld: the arc drops, the arm rests in time, and the next client can weld."""

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.controllers import served, wait_for
from weldsim.controller.ask import ask
from weldsim.execution.ur_modes import SafetyMode

PERIOD = {"cb3": 0.008, "e": 0.002}
AT_REST = 0.02  # [rad/s]
LIMIT = {"kill": 0.5}  # [s] any other: 0.3
SLACK = 0.15  # [s] for asking, on a machine that others use too

FAULTS = ("kill", "protective-stop", "emergency-stop", "link-drop", "stall", "foreign-program")


@pytest.fixture(scope="module", params=("cb3", "e"))
def controller(request: pytest.FixtureRequest) -> Iterator[tuple[str, str]]:
    """Profile and address of a controller."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with served("--profile", request.param) as host:
        yield request.param, host


@contextmanager
def welding(controller: tuple[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A client that welds."""
    series, host = controller
    command = [sys.executable, "-m", "tests.ur_weld", host, str(PERIOD[series])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as client:
        assert client.stdout is not None
        patience = threading.Timer(30.0, client.kill)  # the client may hang for minutes
        patience.start()
        try:
            assert any("WELDING" in line for line in client.stdout)
            yield client
        finally:
            patience.cancel()
            client.kill()


def state(host: str) -> dict[str, Any]:
    return ask(host, {"status": True})


def calm(now: dict[str, Any]) -> bool:
    return not now["digital_out"] & 1 and max(map(abs, now["qd"])) < AT_REST


@pytest.mark.parametrize("fault", FAULTS)
def test_arc_drops_and_arm_rests_in_time(controller, fault):
    _, host = controller
    with welding(controller) as client:
        before = state(host)
        assert before["digital_out"] & 1
        assert not calm(before)
        began = time.monotonic()
        if fault == "kill":
            client.kill()
        else:
            ask(host, {"fault": fault, "seconds": 1.0})
        limit = LIMIT.get(fault, 0.3)
        if fault == "stall":  # it answers nobody, us neither: what it says afterwards has to do
            after = state(host)
            assert calm(after)
            assert any("watchdog" in text for _, text in after["log"])
        else:
            assert wait_for(lambda: calm(state(host)), 3.0, 0.005)
            assert time.monotonic() - began < limit + SLACK
    ask(host, {"fault": "recover"})
    assert state(host)["safety_mode"] == SafetyMode.NORMAL.name


def test_client_notices_a_program_that_ended(controller):
    _, host = controller
    with welding(controller) as client:
        ask(host, {"fault": "emergency-stop"})
        assert client.stdout is not None
        assert any("ENDED" in line for line in client.stdout)
    ask(host, {"fault": "recover"})


def test_local_control_stops_an_e_series_and_nothing_else(controller):
    series, host = controller
    with welding(controller):
        ask(host, {"fault": "local-control"})
        time.sleep(0.3)
        assert calm(state(host)) == (series == "e")
    ask(host, {"fault": "recover"})
    assert wait_for(lambda: calm(state(host)))
