"""A third tour, as somebody writes it who knows the arm and not the controller: ur_rtde's example poses, motion laws, force mode.

Runs in a process of its own, `python -m tests.ur_stranger ADDRESS`, as `tests.ur_tour` does.
"""

import json
import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import dashboard_client
import rtde_control
import rtde_io
import rtde_receive

from tests.ur_tour import away, told

EXAMPLE = [-1.54, -1.83, -2.28, -0.59, 1.60, 0.023]  # where ur_rtde's examples begin
DOWN = [0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0]
REST = 0.05  # [s] for what was reported to arrive


def watch(receive: Any, call: Callable[[], Any], *reads: str) -> tuple[Any, list[list[Any]]]:
    """What a call answered, and rows of time and readings while it ran."""
    answer: list[Any] = []
    thread = threading.Thread(target=lambda: answer.append(call()))
    thread.start()
    rows: list[list[Any]] = []
    while thread.is_alive():
        t = receive.getTimestamp()
        if not rows or t != rows[-1][0]:
            rows.append([t, *(getattr(receive, read)() for read in reads)])
        time.sleep(0.001)
    return answer[0], rows


def visit(host: str) -> dict[str, Any]:
    """The answers, by what was asked."""
    receive, io = rtde_receive.RTDEReceiveInterface(host), rtde_io.RTDEIOInterface(host)
    dashboard = dashboard_client.DashboardClient(host)
    dashboard.connect()
    control = rtde_control.RTDEControlInterface(host)
    seen: dict[str, Any] = {}
    pose = [-0.143, -0.435, 0.20, -0.001, 3.12, 0.04]
    corner, end = [-0.143, -0.51, 0.21, *pose[3:]], [-0.32, -0.61, 0.31, *pose[3:]]
    seen["examples"] = [
        control.moveJ(EXAMPLE, 3.0, 6.0),
        control.moveL(pose, 0.5, 1.0),
        control.moveL([[*pose, 0.8, 1.5, 0.0], [*corner, 0.8, 1.5, 0.02], [*end, 0.8, 1.5, 0.0]]),
    ]
    seen["examples_off"] = away(told(receive).getActualTCPPose()[:3], end[:3])

    answers = [control.forceMode([0.0] * 6, [0, 0, 1, 0, 0, 0], [0, 0, -10, 0, 0, 0], 2, [2, 2, 1.5, 1, 1, 1]) for _ in range(20)]
    seen["force"] = [all(answers), control.forceModeStop(), control.isProgramRunning()]

    seen["down"] = [control.moveJ(DOWN, 3.0, 6.0)]
    start = told(receive).getActualTCPPose()
    for k, way in ((2, -0.10), (0, -0.08), (2, 0.10)):  # from the pose with round angles, along two axes
        goal = told(receive).getTargetTCPPose()
        goal[k] += way
        seen["down"].append(control.moveL(goal, 0.6, 2.0))
    there = told(receive).getActualTCPPose()
    seen["down_off"] = away(there[:3], [start[0] - 0.08, start[1], start[2]])

    control.moveJ([0.4, *DOWN[1:]], 2.0, 4.0)
    io.setSpeedSlider(0.5)
    time.sleep(0.2)
    _, rows = watch(receive, lambda: control.moveJ(DOWN, 0.8, 4.0), "getTargetQd", "getSpeedScalingCombined")
    moving = [t for t, qd, _ in rows if abs(qd[0]) > 1e-6]
    seen["slow"] = [moving[-1] - moving[0], max(abs(qd[0]) for _, qd, _ in rows), rows[-1][2]]
    io.setSpeedSlider(1.0)
    time.sleep(0.2)

    goal = receive.getTargetTCPPose()
    goal[2] += 0.10
    seen["fast"], rows = watch(receive, lambda: control.moveL(goal, 3.0, 150.0), "getSpeedScaling", "getTargetQd")
    seen["limited"] = [min(row[1] for row in rows), max(max(map(abs, row[2])) for row in rows), receive.getSafetyMode()]

    control.moveJ([0.6, *DOWN[1:]], 0.4, 2.0, True)
    time.sleep(0.3)
    seen["waypoint"] = [control.getTargetWaypoint()[:3], control.getForwardKinematics([0.6, *DOWN[1:]], [0, 0, 1e-9, 0, 0, 0])[:3]]
    dashboard.pause()
    time.sleep(0.3)
    seen["paused"] = [receive.getRuntimeState(), max(map(abs, receive.getActualQd()))]
    dashboard.play()
    while control.getAsyncOperationProgress() >= 0:
        time.sleep(0.01)
    seen["resumed_off"] = away(told(receive).getActualQ(), [0.6, *DOWN[1:]])

    control.speedL([0, 0, 0.1, 0, 0, 0], 0.5)
    rows = []
    while receive.getTargetTCPSpeed()[2] < 0.0999 and len(rows) < 500:
        rows.append([receive.getTimestamp(), receive.getTargetTCPSpeed()[2]])
        time.sleep(0.002)
    (t0, v0), (t1, v1) = next(row for row in rows if row[1] > 0.01), rows[-1]
    seen["acceleration"] = [(v1 - v0) / (t1 - t0), control.speedStop()]

    control.stopScript()
    control.disconnect()
    states = []
    for ask in (dashboard.powerOff, dashboard.powerOn, dashboard.brakeRelease):
        ask()
        time.sleep(REST)
        states.append([receive.getRobotMode(), receive.getJointMode()[0], receive.getActualRobotVoltage()])
    seen["power"] = states
    again = []
    for _ in range(4):
        control = rtde_control.RTDEControlInterface(host)
        again.append(control.moveJ(receive.getActualQ()))
        control.disconnect()
    return seen | {"again": again, "gravity": receive.getActualToolAccelerometer()}


if __name__ == "__main__":
    answers = visit(sys.argv[1])
    sys.stdout.flush()
    print("\nANSWERS " + json.dumps(answers))
