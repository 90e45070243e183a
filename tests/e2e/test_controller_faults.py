"""What goes wrong in mid-weld: the arc drops, the arm rests in time, and the next client can weld.

How long it took is read from the controller's own record, in its own time.
"""

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.controllers import PATIENCE
from tests.machine import ATTEMPTS
from tests.ur_drill import Drill, HeldUpError, Record, drilled
from weldsim.controller.ask import ask
from weldsim.execution.ur_modes import SafetyMode

PERIOD = {"cb3": 0.008, "e": 0.002}
LIMIT = {"kill-client": 0.5}  # [s] any other: 0.3
FAULTS = ("kill-client", "protective-stop", "emergency-stop", "link-drop", "stall", "foreign-program")


@pytest.fixture(scope="module", params=("cb3", "e"))
def drill(request: pytest.FixtureRequest) -> Iterator[Drill]:
    """A controller that keeps a record."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with drilled(request.param) as found:
        yield found


@contextmanager
def welding(drill: Drill) -> Iterator[subprocess.Popen[str]]:
    """A client that welds. Raises HeldUpError where its weld ends before it is disturbed."""
    command = [sys.executable, "-m", "tests.ur_weld", drill.host, str(PERIOD[drill.series])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as client:
        assert client.stdout is not None
        patience = threading.Timer(2 * PATIENCE, client.kill)  # the client may hang for minutes
        patience.start()
        try:
            if not any("WELDING" in line for line in client.stdout) or not drill.record().welding:
                raise HeldUpError(drill.record().log)
            yield client
        finally:
            patience.cancel()
            client.kill()


def struck(drill: Drill, act: str, ends: bool = True) -> Record:
    """The record of a weld that was struck in the middle; begun again where this machine held up client or watchdog before."""
    for _ in range(ATTEMPTS):
        drill.watch()
        try:
            with welding(drill) as client:
                record = drill.strike(act, client=client.pid, calm=ends)
                if act == "emergency-stop":  # the client notices
                    assert client.stdout is not None
                    assert any("ENDED" in line for line in client.stdout)
            return record
        except HeldUpError as held:
            why = held
    pytest.fail(f"no weld in {ATTEMPTS} attempts: {why}")


@pytest.mark.parametrize("fault", FAULTS)
def test_arc_drops_and_arm_rests_in_time(drill: Drill, fault: str) -> None:
    record = struck(drill, fault)
    limit = LIMIT.get(fault, 0.3)
    assert record.after(record.arc) < limit, record.log
    assert record.after(record.moving) < limit, record.log
    if fault in ("stall", "link-drop", "kill-client"):
        assert any("watchdog" in text for _, text in record.log)
    ask(drill.host, {"fault": "recover"})
    assert ask(drill.host, {"status": True})["safety_mode"] == SafetyMode.NORMAL.name


def test_local_control_stops_an_e_series_and_nothing_else(drill: Drill) -> None:
    e_series = drill.series == "e"
    record = struck(drill, "local-control", ends=e_series)
    if e_series:
        assert max(record.after(record.arc), record.after(record.moving)) < 0.3
    else:  # sooner than its watchdog would end it, should the machine hold up the client
        soon = (record.t > record.struck) & (record.t < record.struck + 0.1)
        assert soon.any()
        assert (record.arc & record.playing)[soon].all()
    ask(drill.host, {"fault": "recover"})
