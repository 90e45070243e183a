"""A process that welds through SafetyGate(UrRobot), again and again, to be struck: `python experiments/drill_owner.py HOST FILE`.

FILE holds the joint trajectory. Each line {"run": {"boxes": FOLDER, "stop_at": T or null}} on standard input is one connection and
one weld; T is the share of it after which the owner itself asks for a stop. Prints {"connected": PID} and, in the end, one JSON
object: what was raised, how long each step took on the wall's clock, and the log. A line {"again": true} is a connection alone.
"""

import json
import pickle
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from weldsim.errors import ExecutionError
from weldsim.execution.black_box import read_black_box
from weldsim.execution.gate import SafetyGate
from weldsim.execution.runner import execute
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_robot import UrRobot
from weldsim.records import ExecutionLog


class EnoughError(Exception):
    """The owner's own wish to stop."""


def weld_once(host: str, trajectory: Any, asked: dict[str, Any]) -> dict[str, Any]:
    """One connection, one weld, and what can be said of it."""
    robot = UrRobot(UrConfig(host=host))
    folder = Path(asked["boxes"])
    gate = SafetyGate(robot, arc=True, folder=folder)
    seen: dict[str, Any] = {"rule": None, "text": "", "log": None, "box": None, "late": 0, "step": "connect"}
    began = time.monotonic()
    stop_at = asked.get("stop_at")

    def progress(done: float) -> None:
        if stop_at is not None and done >= stop_at:
            raise EnoughError

    try:
        gate.connect()
        seen |= {"connect": time.monotonic() - began, "origin": robot._origin, "step": "weld"}
        print(json.dumps({"connected": robot.client_pid}), flush=True)
        log = execute(gate, trajectory, progress=progress)
        seen |= told(log)
        seen["step"] = "disconnect"
    except ExecutionError as error:
        seen |= {"rule": error.data.get("rule"), "text": str(error)}
        found = error.data.get("log")
        if isinstance(found, ExecutionLog):
            seen |= told(found)
    except EnoughError:
        seen |= {"rule": "asked", "text": "stopped on request"}
    except Exception as error:  # a defect: told, not hidden
        seen |= {"rule": "DEFECT", "text": f"{type(error).__name__}: {error}"}
    seen["welded"] = time.monotonic() - began
    began = time.monotonic()
    try:
        gate.disconnect()
    except Exception as error:
        seen |= {"rule": "DEFECT", "text": f"{seen['text']}; disconnect: {type(error).__name__}: {error}"}
    seen["disconnect"] = time.monotonic() - began
    seen["arc"] = robot.arc
    if gate.black_box is not None:
        box = read_black_box(gate.black_box)
        seen["box"] = {
            "reason": box.reason,
            "t": box.t.tolist(),
            "kinds": [event.kind for event in box.events],
            "speed": float(np.abs(box.qd_act[-1]).max()) if len(box.t) else None,
            "arc": bool(box.arc[-1]) if len(box.t) else None,
        }
    return seen


def connect_once(host: str) -> dict[str, Any]:
    """One connection: the rule that refused it, or None."""
    began = time.monotonic()
    try:
        with SafetyGate(UrRobot(UrConfig(host=host))) as gate:
            gate.facts()
    except ExecutionError as error:
        return {"again": error.data.get("rule"), "text": str(error), "took": time.monotonic() - began}
    return {"again": None, "text": "", "took": time.monotonic() - began}


def told(log: ExecutionLog) -> dict[str, Any]:
    return {
        "log": log.t.tolist(),
        "period": log.period,
        "last_speed": float(np.abs(log.qd_act[-1]).max()),
        "last_arc": bool(log.arc_on[-1]),
        "burnt": bool(log.arc_on.any()),
        "events": [(event.t, event.kind, event.text) for event in log.events],
        "late": sum(event.kind == "late" for event in log.events),
    }


def main(host: str, file: str) -> None:
    trajectory = pickle.loads(Path(file).read_bytes())  # written by the drill itself
    print(json.dumps({"owner": "ready"}), flush=True)
    for line in sys.stdin:
        asked = json.loads(line)
        answer = {"ended": weld_once(host, trajectory, asked["run"])} if "run" in asked else connect_once(host)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
