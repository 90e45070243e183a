"""How well UrRobot keeps time: its servoJ calls, and what the stream of states and commands costs, behind the safety gate.

Prints median, p95 and p99 of the time between two servoJ calls, for each profile of the virtual controller. Run it on a machine
that does nothing else.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np

from weldsim.execution.gate import SafetyGate
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_robot import UrRobot

HOSTS = {"cb3": "127.12.0.1", "e": "127.12.0.2"}
SWING, LAP = 0.05, 5.0  # [rad] that every joint goes to and fro in [s]


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
    if asked.json:
        print(json.dumps({"figures": figures, "load": os.getloadavg()}))
        return
    print(f"servoJ period and CPU time a period of this process [ms], {asked.seconds:g} s; load average {os.getloadavg()[0]:.1f}")
    for series, row in figures.items():
        print(f"  {series:4} " + "   ".join(f"{key} {value:7.3f}" for key, value in row.items()))


if __name__ == "__main__":
    main()
