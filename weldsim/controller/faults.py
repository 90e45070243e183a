"""Faults to order: what can go wrong with a cell, by name, over a small control port of its own."""

import json
from typing import TYPE_CHECKING, get_args

from weldsim.controller.fault_names import FaultName
from weldsim.errors import InputError
from weldsim.execution.ur_modes import RobotMode

if TYPE_CHECKING:
    from weldsim.controller.server import Server

FOREIGN = "def foreign_program():\n  while True:\n    sync()\n  end\nend\n"
MAX_SECONDS = 60.0
MAX_LINE = 4096


def inject(server: "Server", name: str, seconds: float = 1.0) -> str:
    """What was done, in a few words.

    Args:
        server: whose controller.  name: one of `FaultName`.  seconds: how long, for `stall` and `link-drop`.
    Raises:
        InputError: no such fault, or a time that makes no sense.
    """
    machine = server.machine
    if name not in get_args(FaultName):
        raise InputError(f"fault {name!r}: one of {', '.join(get_args(FaultName))}", name=name)
    if not 0 < seconds <= MAX_SECONDS:
        raise InputError(f"fault {name}: {seconds:g} s, expected over 0, up to {MAX_SECONDS:g} s", value=seconds, limit=MAX_SECONDS)
    match name:
        case "protective-stop":
            machine.protective_stop("ordered")
        case "emergency-stop":
            machine.emergency_stop()
        case "stall":
            server.stall(seconds)
        case "link-drop":
            server.drop_links(seconds)
        case "foreign-program":
            machine.upload(FOREIGN)
        case "local-control":
            machine.take_local()
        case "remote-control":
            machine.remote = True
        case "recover":
            server.restore_links()
            machine.remote = True
            machine.stop_program()
            machine.release()
            machine.lift()
            machine.power(RobotMode.RUNNING)
    return f"{name}: robot mode {machine.robot_mode.name}, safety mode {machine.safety_mode.name}, {machine.runtime.name.lower()}"


class FaultSession:
    """One client of the control port: a line {"fault": NAME, "seconds": T} or {"status": true}, answered by one JSON object."""

    def __init__(self, server: "Server") -> None:
        self._server, self._rest = server, b""
        self.finished = False

    def greeting(self) -> bytes:
        return b""

    def ended(self) -> None:
        self._rest = b""

    def received(self, data: bytes) -> bytes:
        """The replies to every line that is complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self.finished = len(self._rest) > MAX_LINE
        return b"".join(json.dumps(self._reply(line)).encode() + b"\n" for line in lines)

    def _reply(self, line: bytes) -> dict[str, object]:
        try:
            asked = json.loads(line)
            if asked.get("status"):
                return self._server.status()
            return {"done": inject(self._server, str(asked.get("fault")), float(asked.get("seconds", 1.0)))}
        except (ValueError, TypeError, AttributeError):
            return {"error": "expected a line of JSON with the key fault or status"}
        except InputError as error:
            return {"error": str(error)}
