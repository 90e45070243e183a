"""A weld through UrRobot in a process of its own, `python -m tests.ur_owner ADDRESS`, to be disturbed, held or killed.

A test's own process checks every type at every call, which is too slow for 500 Hz. Prints WELDING and the number of its client
process once the arc burns and the arm moves, and in the end one JSON object after ENDED: rule and text of the error, or none; the
log's times, arc and events; how long the stop took [s], and the arc output after it.
"""

import json
import sys

import numpy as np

from tests.machine import Watch
from tests.ur_robots import CONNECT_TIMEOUT, weld
from weldsim.errors import ExecutionError
from weldsim.execution.gate import SafetyGate
from weldsim.execution.runner import execute
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_robot import UrRobot
from weldsim.records import ExecutionLog

MOVING = 0.05  # [rad/s]


def main(host: str) -> None:
    robot, told = UrRobot(UrConfig(host=host, connect_timeout=CONNECT_TIMEOUT)), False

    def tell(done: float) -> None:
        nonlocal told
        if not told and robot.arc and np.abs(robot.state().qd).max() > MOVING:
            told = True
            print("WELDING", robot.client_pid, flush=True)

    error: ExecutionError | None = None
    with Watch() as watch:
        with SafetyGate(robot, arc=True) as gate:
            try:
                log = execute(gate, weld(robot.state().q, gate.period), progress=tell)
            except ExecutionError as caught:
                error, log = caught, caught.data.get("log")
            ended = watch.clock()
        took = watch.clock() - ended
    print("ENDED", json.dumps(summary(error, log, robot) | {"disconnect": took, "held_up": watch.worst}), flush=True)


def summary(error: ExecutionError | None, log: object, robot: UrRobot) -> dict[str, object]:
    seen: dict[str, object] = {
        "rule": error.data["rule"] if error else None,
        "text": str(error) if error else "",
        "period": robot.period,
        "arc": robot.arc,
    }
    if isinstance(log, ExecutionLog):
        seen |= {"t": log.t.tolist(), "arc_on": log.arc_on.tolist(), "qd": log.qd_act.tolist()}
        seen["events"] = [(event.t, event.kind, event.text) for event in log.events]
    return seen


if __name__ == "__main__":
    main(sys.argv[1])
