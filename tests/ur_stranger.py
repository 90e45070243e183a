"""A third tour, as somebody writes it who knows the arm and not the controller: ur_rtde's example poses, motion laws, force mode.

Runs in a process of its own, `python -m tests.ur_stranger ADDRESS`, as `tests.ur_tour` does.
"""

import json
import math
import sys
from typing import Any

import dashboard_client
import rtde_control
import rtde_io

from tests.ur_record import Recorder
from tests.ur_wait import Receiver, away, later, told, until

EXAMPLE = [-1.54, -1.83, -2.28, -0.59, 1.60, 0.023]  # where ur_rtde's examples begin
DOWN = [0.0, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0]
WATCHED = {"target_qd": "VECTOR6D", "target_TCP_speed": "VECTOR6D", "speed_scaling": "DOUBLE"}


def visit(host: str) -> dict[str, Any]:
    """The answers, by what was asked."""
    receive, io = Receiver(host), rtde_io.RTDEIOInterface(host)
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

    with Recorder(host, WATCHED) as recorder:
        seen |= laws(control, receive, io, recorder)

    control.moveJ([0.6, *DOWN[1:]], 0.15, 2.0, True)  # 4 s, to be held on the way even by who is held up
    until(lambda: control.getAsyncOperationProgress() >= 0 and receive.getActualQ()[0] > 0.05)
    seen["waypoint"] = [control.getTargetWaypoint()[:3], control.getForwardKinematics([0.6, *DOWN[1:]], [0, 0, 1e-9, 0, 0, 0])[:3]]
    dashboard.pause()
    later(receive, 0.3)
    seen["paused"] = [receive.getRuntimeState(), max(map(abs, receive.getActualQd()))]
    dashboard.play()
    until(lambda: control.getAsyncOperationProgress() < 0)
    seen["resumed_off"] = away(told(receive).getActualQ(), [0.6, *DOWN[1:]])

    control.stopScript()
    control.disconnect()
    states = []
    for ask in (dashboard.powerOff, dashboard.powerOn, dashboard.brakeRelease):
        ask()
        told(receive)
        states.append([receive.getRobotMode(), receive.getJointMode()[0], receive.getActualRobotVoltage()])
    seen["power"] = states
    again = []
    for _ in range(4):
        control = rtde_control.RTDEControlInterface(host)
        again.append(control.moveJ(receive.getActualQ()))
        control.disconnect()
    return seen | {"again": again, "gravity": receive.getActualToolAccelerometer()}


def laws(control: Any, receive: Receiver, io: Any, recorder: Recorder) -> dict[str, Any]:
    """How moves speed up, how fast they are, and what slows them down; the arm is at DOWN before and above it after."""
    seen: dict[str, Any] = {}
    control.moveJ([0.4, *DOWN[1:]], 2.0, 4.0)
    io.setSpeedSlider(0.5)
    until(lambda: receive.getSpeedScalingCombined() == 0.5)
    later(receive, 0.4)  # it comes into effect gradually
    _, rows = recorder.during(lambda: control.moveJ(DOWN, 0.8, 4.0))
    moving = [row[0] for row in rows if abs(row[1][0]) > 1e-6]
    seen["slow"] = [moving[-1] - moving[0], max(abs(row[1][0]) for row in rows), told(receive).getSpeedScalingCombined()]
    io.setSpeedSlider(1.0)
    until(lambda: receive.getSpeedScalingCombined() == 1.0)
    later(receive, 0.4)

    goal = receive.getTargetTCPPose()
    goal[2] += 0.10
    seen["fast"], rows = recorder.during(lambda: control.moveL(goal, 3.0, 150.0))
    seen["limited"] = [min(row[3] for row in rows), max(max(map(abs, row[1])) for row in rows), told(receive).getSafetyMode()]

    def speed_up() -> None:
        control.speedL([0, 0, 0.1, 0, 0, 0], 0.5)
        later(receive, 0.3)

    _, rows = recorder.during(speed_up)
    ramp = [(row[0], row[2][2]) for row in rows if 0.01 < row[2][2] < 0.0999]
    (t0, v0), (t1, v1) = ramp[0], ramp[-1]
    return seen | {"acceleration": [(v1 - v0) / (t1 - t0), control.speedStop()]}


if __name__ == "__main__":
    answers = visit(sys.argv[1])
    sys.stdout.flush()
    print("\nANSWERS " + json.dumps(answers))
