"""A second tour of a controller by the unmodified ur_rtde client: what `tests.ur_tour` leaves out, as one JSON object.

Runs in a process of its own, `python -m tests.ur_visit ADDRESS`, as that one does.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dashboard_client
import rtde_control
import rtde_io

from tests.ur_wait import Receiver, away, later, told, until

TOOL = [0.0, 0.048, 0.227, -0.85, 0.0, 0.0]
SKIPPED = ("getDigitalInState", "getDigitalOutState", "getOutputDoubleRegister", "getOutputIntRegister")


def said(ask: Callable[..., Any], *arguments: Any) -> Any:
    """The answer, or the client's complaint."""
    try:
        return ask(*arguments)
    except (RuntimeError, ValueError) as error:
        return f"! {error}"


def visit(host: str) -> dict[str, Any]:
    """The answers, by what was asked."""
    receive, io = Receiver(host), rtde_io.RTDEIOInterface(host)
    dashboard = dashboard_client.DashboardClient(host)
    dashboard.connect()
    seen: dict[str, Any] = {"files": files(dashboard), "power": power(dashboard)}
    control = rtde_control.RTDEControlInterface(host)
    period = 1 / 125 if dashboard.polyscopeVersion().startswith("3") else 1 / 500
    seen |= reports(told(receive)) | tools(control, receive) | signals(control, io, receive)
    seen |= streams(control, receive, period) | paths(control, receive) | refusals(control, receive)
    for client in (control, receive, io, dashboard):
        client.disconnect()
    return seen


def files(dashboard: Any) -> list[Any]:
    """A program file loaded, played, held, played again and stopped; one that is none."""
    said(dashboard.loadURP, "weld.urp")
    out = [dashboard.getLoadedProgram()]
    for ask in (dashboard.play, dashboard.pause, dashboard.play, dashboard.stop):
        ask()
        out.append(dashboard.programState())
    dashboard.send("load weld.txt\n")
    return [*out, dashboard.receive()]


def power(dashboard: Any) -> list[str]:
    out = []
    for ask in (dashboard.powerOff, dashboard.powerOn, dashboard.brakeRelease, dashboard.closeSafetyPopup):
        ask()
        out.append(dashboard.robotmode())
    return out


def reports(receive: Receiver) -> dict[str, Any]:
    """Every value that can be read, and a recording of some."""
    names = [name for name in dir(receive) if name.startswith(("get", "is")) and name not in SKIPPED]
    seen: dict[str, Any] = {"reports": {name: said(getattr(receive, name)) for name in names}}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.csv"
        receive.startFileRecording(str(file), ["timestamp", "actual_q"])
        until(lambda: file.exists() and file.stat().st_size > 5000)
        receive.stopFileRecording()
        rows = [line.split(",") for line in file.read_text().splitlines()]
    seen["recorded"] = [rows[0][:2], len(rows), len(rows[1])]
    return seen


def tools(control: Any, receive: Receiver) -> dict[str, Any]:
    seen: dict[str, Any] = {"setTcp": control.setTcp(TOOL)}
    told(receive)
    q, pose = receive.getActualQ(), receive.getActualTCPPose()
    seen |= {"fk": [away(fk, pose) for fk in (control.getForwardKinematics(), control.getForwardKinematics(q, TOOL))]}
    seen["pose_trans"] = control.poseTrans([0.1, 0.2, 0.3, 0, 0, 1.5707963], [0.1, 0, 0, 0, 0, 0])
    flange = control.getForwardKinematics(q, [1e-12, 0, 0, 0, 0, 0])
    until(lambda: away(control.getActualToolFlangePose()[:3], flange[:3]) < 1e-3)  # returns before the answer is there
    seen["flange"] = [control.getActualToolFlangePose(), flange]
    asked = (control.zeroFtSensor, control.teachMode, control.endTeachMode, control.freedriveMode, control.endFreedriveMode)
    seen["plain"] = [ask() for ask in asked]
    seen["plain"] += [control.setGravity([0, 0, 9.82]), control.setExternalForceTorque([0.0] * 6), control.forceModeStop()]
    seen["still"] = control.isProgramRunning(), control.getFreedriveStatus(), control.isSteady()
    return seen


def signals(control: Any, io: Any, receive: Receiver) -> dict[str, Any]:
    io.setInputIntRegister(19, -7)
    io.setInputDoubleRegister(20, 2.5)
    io.setConfigurableDigitalOut(2, True)
    until(lambda: receive.getDigitalOutState(10))  # and what was sent before it has come too
    body = "  write_output_integer_register(13, read_input_integer_register(19))\n"
    body += "  write_output_float_register(14, read_input_float_register(20))\n"
    seen: dict[str, Any] = {"custom": control.sendCustomScriptFunction("copy_registers", body)}
    script = "def job():\n  set_standard_digital_out(5, True)\n  write_output_integer_register(0, 2)\nend\n"
    seen["custom2"] = control.sendCustomScript(script)
    until(lambda: receive.getDigitalOutState(5) and receive.getOutputIntRegister(13) == -7)
    until(control.isProgramRunning)
    seen["copied"] = receive.getOutputIntRegister(13), receive.getOutputDoubleRegister(14)
    return seen | {"outs": [receive.getDigitalOutState(n) for n in (5, 10, 11)], "after_custom": control.isProgramRunning()}


def streams(control: Any, receive: Receiver, period: float) -> dict[str, Any]:
    """servoL, speeds for a time, jogging in two frames, and watchdogs that are fed."""
    start = receive.getActualTCPPose()
    pose = list(start)
    for k in range(round(0.4 / period)):
        began = control.initPeriod()
        pose[2] = start[2] + 0.05 * k * period
        control.servoL(pose, 0, 0, period, 0.05, 300)
        control.waitPeriod(began)
    later(receive, 0.3)
    seen: dict[str, Any] = {"servoL_off": away(receive.getActualTCPPose()[:3], pose[:3]), "servoL_stop": control.servoStop()}
    seen["jogs"] = []
    for feature in (0, 1):
        control.jogStart([0.0, 0.0, 0.02, 0.0, 0.0, 0.0], feature)
        later(receive, 0.4)
        seen["jogs"].append((receive.getActualTCPSpeed(), receive.getActualTCPPose()))
        control.jogStop()
    seen["watchdog"] = control.setWatchdog(1.0)
    end = time.monotonic() + 1.5
    while time.monotonic() < end:
        time.sleep(0.05)
        control.kickWatchdog()
    return seen | {"fed": control.isProgramRunning(), "reupload": control.reuploadScript()}


def paths(control: Any, receive: Receiver) -> dict[str, Any]:
    """A path with blends of mixed moves, and asynchronous ones told by their progress."""
    later(receive, 0.1)
    until(control.isProgramRunning)
    q = receive.getActualQ()
    other = [q[0] + 0.15, *q[1:]]
    path = rtde_control.Path()
    for target in (other, q):
        path.addEntry(
            rtde_control.PathEntry(rtde_control.PathEntry.MoveJ, rtde_control.PathEntry.PositionJoints, [*target, 1.0, 2.0, 0.0])
        )
    seen: dict[str, Any] = {"movePath": control.movePath(path, False), "movePath_off": away(told(receive).getActualQ(), q)}
    control.moveJ([[*other, 0.2, 2.0, 0.01], [*q, 0.2, 2.0, 0.0]], True)
    until(lambda: control.getAsyncOperationProgress() >= 0)
    progress: list[int] = []
    until(lambda: progress.append(control.getAsyncOperationProgress()) or progress[-1] < 0)
    seen |= {"progress": sorted(set(progress)), "path_off": away(told(receive).getActualQ(), q)}
    pose = receive.getActualTCPPose()
    pose[2] += 0.05
    control.moveL(pose, 0.02, 1.0, True)
    until(lambda: pose[2] - receive.getActualTCPPose()[2] < 0.045)
    control.stopL(10.0)
    later(receive, 0.05)
    left = pose[2] - receive.getActualTCPPose()[2]
    return seen | {"stopL_left": left, "stopL_speed": max(map(abs, receive.getActualQd()))}


def refusals(control: Any, receive: Receiver) -> dict[str, Any]:
    """What a controller cannot do: the call returns, the program has ended, and the next one works."""
    q, seen = receive.getActualQ(), {}
    asked: dict[str, Callable[[], Any]] = {
        "moveJ": lambda: control.moveJ([7.0, *q[1:]]),
        "moveL": lambda: control.moveL([3.0, 0, 0, 0, 0, 0]),
        "moveJ_IK": lambda: control.moveJ_IK([3.0, 0, 0, 0, 0, 0]),
        "ik": lambda: control.getInverseKinematics([3.0, 0, 0, 0, 0, 0]),
    }
    for name, ask in asked.items():
        began = time.monotonic()
        answer = said(ask)
        took = time.monotonic() - began
        ended = until(lambda: not control.isProgramRunning())
        control.reuploadScript()
        until(control.isProgramRunning)
        seen[name] = {"answer": answer, "took": took, "ended": ended, "again": control.moveJ(receive.getActualQ())}
    return {"refused": seen, "has_ik": control.getInverseKinematicsHasSolution([3.0, 0, 0, 0, 0, 0])}


if __name__ == "__main__":
    answers = visit(sys.argv[1])
    sys.stdout.flush()
    print("\nANSWERS " + json.dumps(answers))
