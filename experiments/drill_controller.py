"""A virtual controller that keeps a record of its own and strikes at a given instant, `python experiments/drill_controller.py ...`.

It is asked by lines of JSON on its standard input, between two control periods, and answers each with one on its standard output:

    {"watch": true}          begins a record
    {"strike": {"after": EVENT, "delay": T, "acts": [[T0, NAME, NUMBER], ...]}, "pids": {"owner": N, "client": N}}
    {"mend": true}           what was broken by `strike` works again
    {"rows": FILE}           the record, as an NPZ

EVENT is `now`, `motion`, `arc on`, `arc off`; an act is due T0 seconds after the strike. Acts are the controller's faults, signals
to processes (`kill-client`, `hold-client`, `kill-owner`, `hold-owner`), and what a network does (`deaf`: nothing is received for
NUMBER seconds, `mute`: nothing sent, `dashboard-gone`, `dashboard-silent`). All times are the controller's.
"""

import argparse
import json
import os
import selectors
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

import numpy as np

from weldsim.config import load_scene
from weldsim.controller.config import ControllerConfig
from weldsim.controller.connection import Connection
from weldsim.controller.dashboard import DashboardSession
from weldsim.controller.fault_names import FaultName
from weldsim.controller.faults import FaultSession, inject
from weldsim.controller.server import Server
from weldsim.controller.start import new_server
from weldsim.execution.priority import hurry

MOVING = 1e-4  # [rad/s] of the reference: the arm is commanded to move
SIGNALS = {"kill": signal.SIGKILL, "hold": signal.SIGSTOP, "go": signal.SIGCONT}
COLUMNS = ("t", "wall", "arc", "speed", "runtime", "safety")


class Broken:
    """What of the network does not work, until when [s, perf_counter]."""

    def __init__(self) -> None:
        self.mend()

    def mend(self) -> None:
        self.deaf = self.mute = self.dashboard_gone = self.dashboard_silent = 0.0

    def now(self, name: str) -> bool:
        return time.perf_counter() < getattr(self, name)


class Watched:
    """A server, its record, and the strike that is to come."""

    def __init__(self, server: Server, channel: int) -> None:
        self.server, self.broken, self._channel, self._text = server, Broken(), channel, b""
        self.rows: list[tuple[float, ...]] = []
        self.struck: list[tuple[float, str]] = []
        self._strike: dict[str, Any] | None = None
        self._pids: dict[str, int] = {}
        self._due: list[tuple[float, str, float]] = []
        self._moved = self._burnt = self._out = False
        self._selector = selectors.SelectSelector()
        self._selector.register(channel, selectors.EVENT_READ)
        break_network(self.broken)
        machine = server.machine
        advance = machine.tick

        def tick() -> None:
            advance()
            self._watch()

        machine.tick = tick

    def _watch(self) -> None:
        machine = self.server.machine
        arc, speed = machine.io.digital_out & 1, max(map(abs, machine.arm.qd))
        self.rows.append((machine.t, time.monotonic(), arc, speed, float(machine.runtime), float(machine.safety_mode)))
        self._moved = self._moved or max(map(abs, machine.reference.qd)) > MOVING
        self._out = self._out or (self._burnt and not arc)
        self._burnt = self._burnt or bool(arc)
        if self._strike is not None and self._has_come(self._strike["after"]):
            begin = machine.t + self._strike["delay"]
            self._due = sorted((begin + t0, name, number) for t0, name, number in self._strike["acts"])
            self._strike = None
        while self._due and machine.t >= self._due[0][0] - 1e-9:
            _, name, number = self._due.pop(0)
            self.struck.append((machine.t, name))
            self.act(name, number)
        if self._selector.select(0):
            self._hear()

    def _has_come(self, event: str) -> bool:
        return {"now": True, "motion": self._moved, "arc on": self._burnt, "arc off": self._out}[event]

    def act(self, name: str, number: float) -> None:
        """Do it. Raises KeyError for what is unknown."""
        how, _, whom = name.partition("-")
        if name in get_args(FaultName):
            inject(self.server, name, number)
        elif how in SIGNALS:
            with suppress(ProcessLookupError):
                os.kill(self._pids[whom], SIGNALS[how])
        else:
            setattr(self.broken, name.replace("-", "_"), time.perf_counter() + number)

    def _hear(self) -> None:
        data = os.read(self._channel, 65536)
        if not data:
            self.server.stop()
            return
        *lines, self._text = (self._text + data).split(b"\n")
        for line in lines:
            print(json.dumps(self._answer(json.loads(line))), flush=True)

    def _answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        if "watch" in asked:
            self.rows, self.struck, self._due = [], [], []
            self._moved = self._burnt = self._out = False
        elif "strike" in asked:
            self._strike, self._pids = asked["strike"], asked.get("pids", self._pids)
        elif "rows" in asked:
            path, rows = Path(asked["rows"]), np.array(self.rows).reshape(-1, len(COLUMNS))
            part = path.with_suffix(".part.npz")
            np.savez(part, allow_pickle=False, **{name: rows[:, k] for k, name in enumerate(COLUMNS)})
            os.replace(part, path)
            log = [[t, text] for t, text in self.server.machine.log if not len(rows) or t >= rows[0, 0]]
            return {"struck": self.struck, "log": log, "lost": self.server.lost, "overruns": self.server.overruns}
        elif "mend" in asked:
            self._strike, self._due = None, []
            self.broken.mend()
            inject(self.server, "recover")
        return {"t": self.server.machine.t}


def break_network(broken: Broken) -> None:
    """Every connection of this process does from now on what `broken` says; the fault port always works."""
    receive, flush = Connection.receive, Connection.flush
    greeting, received = DashboardSession.greeting, DashboardSession.received

    def hears(self: Connection) -> None:
        if broken.now("deaf") and not isinstance(self.session, FaultSession):
            time.sleep(2e-4)  # it stays readable
            return
        if broken.now("dashboard_gone") and isinstance(self.session, DashboardSession):
            self.close()
            return
        receive(self)

    def speaks(self: Connection) -> None:
        if broken.now("mute") and not isinstance(self.session, FaultSession):
            return
        flush(self)

    def greets(self: DashboardSession) -> bytes:
        self.finished = broken.now("dashboard_gone")
        return b"" if broken.now("dashboard_silent") or self.finished else greeting(self)

    def answers(self: DashboardSession, data: bytes) -> bytes:
        return b"" if broken.now("dashboard_silent") else received(self, data)

    Connection.receive, Connection.flush = hears, speaks
    DashboardSession.greeting, DashboardSession.received = greets, answers


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--profile", choices=("cb3", "e"), required=True)
    parser.add_argument("--host", required=True)
    parser.add_argument("--scene", default="")
    parser.add_argument("--speed", type=float, default=1.0)
    asked = parser.parse_args()
    scene = load_scene(asked.scene) if asked.scene else None
    server = new_server(asked.profile, scene, ControllerConfig(speed=asked.speed), asked.host)
    Watched(server, sys.stdin.fileno())
    print(json.dumps({"serving": asked.host}), flush=True)
    if asked.speed <= 1.0:
        hurry()
    server.run()


if __name__ == "__main__":
    main()
