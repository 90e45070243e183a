"""A weld through UrRobot in a process of its own, `python -m tests.ur_owner ADDRESS`, to be killed or held.

Prints WELDING with the process number of its client once the arc burns, and the rule of the error that ends it.
"""

import sys

import numpy as np

from weldsim.errors import ExecutionError
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_robot import UrRobot


def weld(host: str) -> None:
    robot = UrRobot(UrConfig(host=host))
    with robot:
        start, told = robot.state().q, False
        for k in range(round(20 / robot.period)):
            t = k * robot.period
            robot.set_arc(t > 0.1)
            robot.servo(start + 0.3 * np.array([1 - np.cos(t), 0, 0, 0, 0, 0]), np.zeros(6))
            if t > 0.4 and robot.arc and not told:
                told = True
                print("WELDING", robot.client_pid, flush=True)


if __name__ == "__main__":
    try:
        weld(sys.argv[1])
    except ExecutionError as error:
        print("ENDED", error.data["rule"], error, flush=True)
