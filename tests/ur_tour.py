"""What the unmodified ur_rtde client sees of a controller, as one JSON object.

Runs in a process of its own, `python -m tests.ur_tour ADDRESS`: the client's constructors hold the interpreter, and it may hang.
"""

import json
import math
import sys
import time
from itertools import pairwise
from typing import Any

import dashboard_client
import rtde_control
import rtde_io

from tests.controllers import UNLOCK_DELAY
from tests.ur_wait import Receiver, away, later, told, until


def tour(host: str) -> dict[str, Any]:
    """The answers, by what was asked."""
    receive = Receiver(host)
    io = rtde_io.RTDEIOInterface(host)
    dashboard = dashboard_client.DashboardClient(host)
    dashboard.connect()
    seen: dict[str, Any] = {
        "version": dashboard.polyscopeVersion(),
        "robot_mode": receive.getRobotMode(),
        "dashboard_mode": dashboard.robotmode(),
        "model": dashboard.getRobotModel(),
    }
    control = rtde_control.RTDEControlInterface(host)
    seen["running"] = control.isProgramRunning(), told(receive).getRuntimeState(), dashboard.running()
    seen |= moves(control, receive)
    seen |= kinematics(control, receive)
    seen |= signals(io, receive)
    seen |= streams(control, receive, 1 / 125 if seen["version"].startswith("3") else 1 / 500)
    seen |= stops(control, receive, dashboard)
    for client in (control, receive, io, dashboard):
        client.disconnect()
    return seen


def moves(control: Any, receive: Receiver) -> dict[str, Any]:
    q = receive.getActualQ()
    q[0] += 0.2
    seen: dict[str, Any] = {"moveJ": control.moveJ(q, 1.0, 2.0), "moveJ_off": away(told(receive).getActualQ(), q)}
    pose = receive.getActualTCPPose()
    pose[2] += 0.04
    seen |= {"moveL": control.moveL(pose, 0.2, 1.0), "moveL_off": away(told(receive).getActualTCPPose()[:3], pose[:3])}
    pose[2] -= 0.04
    seen |= {"moveJ_IK": control.moveJ_IK(pose, 1.0, 2.0), "moveJ_IK_off": away(told(receive).getActualTCPPose()[:3], pose[:3])}
    q[0] -= 0.4
    start = receive.getActualQ()
    seen["async"] = control.moveJ(q, 0.1, 2.0, True)  # 4 s, to be stopped on the way even by who is held up
    until(lambda: control.getAsyncOperationProgress() >= 0 and away(receive.getActualQ(), start) > 0.02)
    seen["async_progress"] = control.getAsyncOperationProgress()
    control.stopJ(4.0)
    later(receive, 0.05)
    seen |= {"stopJ_speed": max(map(abs, receive.getActualQd())), "stopJ_short": away(receive.getActualQ(), q)}
    seen["path"] = control.moveJ([[*q, 1.0, 2.0, 0.0], [*(x + 0.1 for x in q), 1.0, 2.0, 0.0]])
    seen["path_off"] = away(told(receive).getActualQ(), [x + 0.1 for x in q])
    return seen


def kinematics(control: Any, receive: Receiver) -> dict[str, Any]:
    q, tool = receive.getActualQ(), [0.01, 0.02, 0.1, 0.1, 0.0, 0.0]
    seen: dict[str, Any] = {"setTcp": control.setTcp(tool), "tcp_offset": control.getTCPOffset(), "q": q}
    seen |= {"setPayload": control.setPayload(1.3, [0.0, 0.01, 0.05])}
    told(receive)
    seen |= {"payload": receive.getPayload(), "cog": receive.getPayloadCog(), "tcp_pose": receive.getActualTCPPose()}
    seen |= {"fk": control.getForwardKinematics(q, tool), "ik": control.getInverseKinematics(seen["tcp_pose"])}
    seen["ik_near"] = control.getInverseKinematics(seen["tcp_pose"], q)
    seen["has_ik"] = [control.getInverseKinematicsHasSolution(pose) for pose in (seen["tcp_pose"], [3.0, 0, 0, 0, 0, 0])]
    seen["safe"] = control.isPoseWithinSafetyLimits(seen["tcp_pose"]), control.isJointsWithinSafetyLimits(q), control.isSteady()
    return seen


def signals(io: Any, receive: Receiver) -> dict[str, Any]:
    seen: dict[str, Any] = {"digital": []}
    for on in (True, False):
        io.setStandardDigitalOut(3, on)
        io.setToolDigitalOut(1, on)
        until(lambda bits=(1 << 3 | 1 << 17) * on: receive.getActualDigitalOutputBits() == bits)
        seen["digital"].append(receive.getActualDigitalOutputBits())
    io.setAnalogOutputVoltage(0, 0.25)
    io.setAnalogOutputCurrent(1, 0.5)
    io.setSpeedSlider(0.5)
    until(lambda: receive.getSpeedScalingCombined() == 0.5)
    seen["analog"] = receive.getStandardAnalogOutput0(), receive.getStandardAnalogOutput1()
    seen["slider"] = receive.getSpeedScalingCombined()
    io.setSpeedSlider(1.0)
    until(lambda: receive.getSpeedScalingCombined() == 1.0)
    return seen


def streams(control: Any, receive: Receiver, period: float) -> dict[str, Any]:
    start, count, times = receive.getActualQ(), round(0.8 / period), []
    q = list(start)
    for k in range(count):
        began = control.initPeriod()
        times.append(time.perf_counter())
        q[1] = start[1] + 0.05 * (1 - math.cos(math.pi * k / count))
        if not control.servoJ(q, 0, 0, period, 0.03, 300):
            break
        control.waitPeriod(began)
    gaps = sorted(b - a for a, b in pairwise(times))
    seen: dict[str, Any] = {"servo_period": gaps[len(gaps) // 2], "servo_count": len(times) / count}
    later(receive, 0.2)
    seen |= {"servo_off": away(receive.getActualQ(), q), "servoStop": control.servoStop()}
    seen["speedL"] = control.speedL([0, 0, 0.04, 0, 0, 0], 0.5)
    later(receive, 0.4)
    seen |= {"tcp_speed": receive.getActualTCPSpeed(), "speedStop": control.speedStop()}
    seen["speedJ"] = control.speedJ([0.2, 0, 0, 0, 0, 0], 1.4)
    later(receive, 0.4)
    seen |= {"joint_speed": receive.getActualQd(), "speedStop2": control.speedStop()}
    later(receive, 0.05)
    seen["rest"] = max(map(abs, receive.getActualQd()))
    return seen


def stops(control: Any, receive: Receiver, dashboard: Any) -> dict[str, Any]:
    q = receive.getActualQ()
    seen: dict[str, Any] = {"watchdog": control.setWatchdog(10.0)}
    later(receive, 0.3)
    until(lambda: not control.isProgramRunning())
    seen["after_watchdog"] = receive.getRuntimeState()
    seen["reupload"] = control.reuploadScript()
    until(control.isProgramRunning)
    control.triggerProtectiveStop()
    told(receive)
    seen["stopped"] = receive.isProtectiveStopped(), receive.getSafetyMode(), dashboard.safetymode()
    seen["moveJ_stopped"] = control.moveJ(q)
    try:
        dashboard.unlockProtectiveStop()
        seen["early_unlock"] = "done"
    except RuntimeError as error:
        seen["early_unlock"] = str(error)
    later(receive, UNLOCK_DELAY)
    dashboard.unlockProtectiveStop()
    dashboard.stop()
    until(lambda: not control.isProgramRunning())
    seen["reupload2"] = control.reuploadScript()
    until(control.isProgramRunning)
    q[0] += 0.1
    seen |= {"recovered": control.moveJ(q, 1.0, 2.0), "recovered_off": away(told(receive).getActualQ(), q)}
    control.stopScript()
    told(receive)
    seen |= {"stop_script": receive.getRuntimeState(), "still_connected": receive.isConnected()}
    return seen


if __name__ == "__main__":
    answers = tour(sys.argv[1])
    sys.stdout.flush()
    print("\nANSWERS " + json.dumps(answers))
