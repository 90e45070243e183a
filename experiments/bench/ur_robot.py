"""How well UrRobot keeps time: its servoJ calls, and what the stream of states and commands costs, behind the safety gate.

Prints median, p95 and p99 of the time between two servoJ calls, for each profile of the virtual controller, and what the gate
alone takes of a period. Run it on a machine that does nothing else.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np
from numpy import ndarray

from weldsim.execution.gate import SafetyGate
from weldsim.execution.robot import Robot
from weldsim.execution.ur_config import PERIODS, UrConfig
from weldsim.execution.ur_robot import UrRobot
from weldsim.kinematics import torch_pose
from weldsim.records import RobotFacts, RobotState, Segment
from weldsim.scene.world import HOME

HOSTS = {"cb3": "127.12.0.1", "e": "127.12.0.2"}
SWING, LAP = 0.05, 5.0  # [rad] that every joint goes to and fro in [s]


class Nothing(Robot):
    """An arm that is at once where it is told to be, at no cost."""

    def __init__(self, period: float) -> None:
        self.name, self.period, self.arc_on = "nothing", period, False
        self._now = RobotState(t=0.0, q=HOME, qd=np.zeros(6), X_BT=torch_pose(HOME))

    def connect(self) -> None: ...

    def disconnect(self) -> None: ...

    def stop(self) -> None: ...

    def state(self) -> RobotState:
        return self._now

    def facts(self) -> RobotFacts:
        return RobotFacts(model="none", series="simulated", version="1", serial="0")

    def servo(self, q: ndarray, qd: ndarray) -> ndarray:
        self._now = RobotState(t=self._now.t + self.period, q=q, qd=qd, X_BT=self._now.X_BT)
        return q

    def set_arc(self, on: bool) -> None:
        self.arc_on = on

    @property
    def arc(self) -> bool:
        return self.arc_on


def gate_cost(period: float, seconds: float) -> dict[str, float]:
    """Time [ms] of a command through the gate, in a weld, where most is checked; and its share of the period [%]."""
    t = np.arange(0.0, seconds, period)
    sine, cosine = np.sin(np.pi * t / seconds), np.cos(np.pi * t / seconds)
    angle, speed = SWING * sine**4, SWING * 4 * np.pi / seconds * sine**3 * cosine
    times = np.zeros(len(t))
    with SafetyGate(Nothing(period), arc=True) as gate:
        gate.label(Segment.WELD, 0.0)
        for k in range(len(t)):
            q, qd = HOME + angle[k], np.full(6, speed[k])
            began = time.perf_counter()
            gate.servo(q, qd)
            times[k] = time.perf_counter() - began
    median, p99 = (float(np.percentile(times, part)) for part in (50, 99))
    return {"median": round(1e3 * median, 3), "p99": round(1e3 * p99, 3), "share": round(100 * median / period, 1)}


def follow(host: str, seconds: float) -> dict[str, float]:
    """Figures [ms] of one stream; late: commands of the caller that the queue had to bridge for too long."""
    robot = UrRobot(UrConfig(host=host))
    with SafetyGate(robot) as gate:
        start, late = gate.state().q, 0
        used = time.process_time()
        count = round(seconds / gate.period)
        for k in range(count):
            sine, cosine = np.sin(np.pi * k * gate.period / LAP), np.cos(np.pi * k * gate.period / LAP)
            speed = SWING * 4 * np.pi / LAP * sine**3 * cosine  # the fourth power begins without a jerk
            gate.servo(start + SWING * sine**4, np.full(6, speed))
            late += sum(event.kind == "late" for event in gate.events())
        used = (time.process_time() - used) / count
        gaps = np.diff(robot.servo_times)
    figures = {name: round(float(np.percentile(gaps, q)) * 1e3, 3) for name, q in (("median", 50), ("p95", 95), ("p99", 99))}
    return figures | {"cpu": round(used * 1e3, 3), "late": late}


def measure(series: str, seconds: float) -> dict[str, float]:
    """The figures of one profile, the controller in its own process."""
    command = [sys.executable, "-m", "weldsim", "controller", "--profile", series, "--host", HOSTS[series]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        server.stdout.readline()
        try:
            return follow(HOSTS[series], seconds)
        finally:
            server.terminate()
            server.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each measurement")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    figures = {series: measure(series, asked.seconds) for series in HOSTS}
    gates = {series: gate_cost(PERIODS[series], asked.seconds) for series in PERIODS}
    if asked.json:
        print(json.dumps({"figures": figures, "gate": gates, "load": os.getloadavg()}))
        return
    print(f"servoJ period and CPU time a period of this process [ms], {asked.seconds:g} s; load average {os.getloadavg()[0]:.1f}")
    for series, row in figures.items():
        print(f"  {series:4} " + "   ".join(f"{key} {value:7.3f}" for key, value in row.items()))
    print("a command through the safety gate alone [ms], and its share of a period")
    for series, row in gates.items():
        print(f"  {series:4} median {row['median']:.3f}   p99 {row['p99']:.3f}   share {row['share']:.1f} %")


if __name__ == "__main__":
    main()
