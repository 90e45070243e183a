"""UrRobot when something goes wrong in mid-weld: arc off and arm at rest in time, a reason, a log, a next connection.

How long it took is read from the controller's own record: from the strike to the last period with the arc on, or with a joint
moving. A weld that the machine held up before the strike, or whose reason is that, is begun again.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from tests.controllers import PATIENCE, wait_for
from tests.machine import ATTEMPTS, HELD_UP, unless_held_up
from tests.torch_paths import START
from tests.ur_drill import AT_REST, Drill, HeldUpError, Record, calm, drilled
from tests.ur_robots import controlled, place, ur_robot
from weldsim.controller.ask import ask
from weldsim.errors import ExecutionError
from weldsim.execution import ur_link
from weldsim.execution.ur_process import ClientError, ClientProcess

LIMIT, LIMIT_KILLED = 0.3, 0.5  # [s]
RULES = {  # either is true: who silences the controller keeps the client from being answered
    "protective-stop": ("protective_stop",),
    "emergency-stop": ("emergency_stop",),
    "foreign-program": ("foreign_program", "tracking"),
    "link-drop": ("link",),
    "stall": ("silence", "client"),
}
OF_A_MACHINE = {"stall", "silence", "client", "late", "program", "tracking"}  # reasons of a weld that a machine holds up


@pytest.fixture(scope="module", params=("cb3", "e"))
def drill(request: pytest.FixtureRequest) -> Iterator[Drill]:
    """A controller that drops output 0, the arc, when no program runs."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with drilled(request.param) as found:
        yield found


def state(host: str) -> dict[str, Any]:
    return ask(host, {"status": True})


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
    """Somebody who welds, until the block ends. Raises HeldUpError where the weld stops before it is disturbed."""
    place(host, START)
    with subprocess.Popen([sys.executable, "-m", "tests.ur_owner", host], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        patience = threading.Timer(4 * PATIENCE, process.kill)
        patience.start()
        try:
            line = process.stdout.readline()
            if not line.startswith("WELDING"):
                raise HeldUpError(line[:300])
            yield Owner(process, int(line.split()[1]))
        finally:
            patience.cancel()
            process.kill()


def struck(drill: Drill, *acts: str, seconds: float = 1.0, rules: tuple[str, ...] = ()) -> Record:
    """The record of a weld that was struck in the middle; with rules, its owner must tell one of them as the reason.

    A weld that the machine stops by itself is begun again: it is the fault that is tried.
    """
    for _ in range(ATTEMPTS):
        drill.watch()
        try:
            with welding(drill.host) as owner:
                record = drill.strike(*acts, seconds=seconds, client=owner.client, owner=owner.process.pid)
                if rules:
                    if "hold-owner" in acts:
                        owner.process.send_signal(signal.SIGCONT)
                    check_end(owner.ended(), rules, blind=bool({"link-drop", "stall"} & {*acts}))
                assert wait_for(lambda client=owner.client: not os.path.exists(f"/proc/{client}"))
            return record
        except HeldUpError as held:
            why = held
    pytest.fail(f"no weld in {ATTEMPTS} attempts: {why}")


def check_rest(record: Record, limit: float = LIMIT) -> None:
    """Arc off and arm at rest within it [s] of the strike."""
    assert record.after(record.arc) < limit, record.log
    assert record.after(record.moving) < limit, record.log


def check_end(seen: dict[str, Any], rules: tuple[str, ...], blind: bool) -> None:
    """The reason is told, the arc is off, and the log has every period up to the stop, but for one gap where it was `blind`."""
    rule = seen["rule"]
    if rule not in rules and rule in OF_A_MACHINE and seen["held_up"] > HELD_UP:
        raise HeldUpError(seen["text"])
    assert rule in rules, seen["text"]
    assert not seen["arc"]
    gaps = np.diff(seen["t"])
    if blind:  # for some time there was nothing to be had
        gaps = np.delete(gaps, gaps.argmax())
    np.testing.assert_allclose(gaps, seen["period"], rtol=1e-6)
    assert np.abs(seen["qd"][-1]).max() < AT_REST
    assert any(seen["arc_on"])
    assert rule in {kind for _, kind, _ in seen["events"]}
    assert seen["text"] in {text for _, _, text in seen["events"]}
    assert seen["disconnect"] < 4.0


@unless_held_up
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


@pytest.mark.parametrize("fault", RULES)
def test_a_fault_of_the_controller(drill: Drill, fault: str) -> None:
    check_rest(struck(drill, fault, seconds=1.0 if fault == "stall" else 0.4, rules=RULES[fault]))
    check_next(drill.host)


@pytest.mark.parametrize(
    ("fault", "rule"),
    [
        ("protective-stop", "protective_stop"),
        ("emergency-stop", "emergency_stop"),
        ("foreign-program", "foreign_program"),
        ("local-control", "remote_control"),
    ],
)
def test_what_comes_in_the_way_of_a_connection_is_named(
    drill: Drill, fault: str, rule: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client library knows only that its program does not take a setting, or does not start."""
    host = drill.host
    if (drill.series, fault) == ("cb3", "local-control"):
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


def test_local_control_ends_a_weld_on_e_series(drill: Drill) -> None:
    if drill.series == "cb3":  # knows no such switch
        with ur_robot(drill.host) as robot:
            assert robot.facts().remote_control is None
        return
    check_rest(struck(drill, "local-control", rules=("remote_control",)))
    with pytest.raises(ExecutionError, match="remote control"):
        ur_robot(drill.host).connect()
    check_next(drill.host)


@pytest.mark.parametrize("how", ["kill-client", "hold-client"])
def test_a_client_that_dies_or_hangs(drill: Drill, how: str) -> None:
    check_rest(struck(drill, how, rules=("client",)))
    check_next(drill.host)


@pytest.mark.parametrize("whom", [("kill-owner",), ("kill-client", "kill-owner")], ids=" and ".join)
def test_a_killed_owner(drill: Drill, whom: tuple[str, ...]) -> None:
    record = struck(drill, *whom)
    check_rest(record, LIMIT_KILLED)
    check_next(drill.host)


def test_an_owner_that_stalls_is_stopped_and_told(drill: Drill) -> None:
    check_rest(struck(drill, "hold-owner", rules=("stall",)))
    check_next(drill.host)


@unless_held_up
def test_the_arc_goes_off_where_the_controller_does_not_drop_it() -> None:
    """With an installation that keeps its outputs when a program ends, the arc is dropped by us as long as one of us lives."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    with controlled("cb3", "--low-when-stopped", "7") as host:
        for fault in ("protective-stop", "emergency-stop", "foreign-program"):
            with welding(host) as owner:
                ask(host, {"fault": fault})
                assert wait_for(lambda: calm(state(host)))
                assert not owner.ended()["arc"]
        with welding(host) as owner:
            os.kill(owner.client, signal.SIGKILL)
            assert wait_for(lambda: calm(state(host)))
        with welding(host) as owner:
            owner.process.kill()
            assert wait_for(lambda: calm(state(host)))
