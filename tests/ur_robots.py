"""UrRobots for tests, each on a virtual controller of its own process."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy import ndarray

from tests.controllers import PATIENCE, served, wait_for
from weldsim.controller.ask import ask
from weldsim.execution.ur_config import Series, UrConfig
from weldsim.execution.ur_ports import REALTIME
from weldsim.execution.ur_robot import UrRobot
from weldsim.kinematics import JOINT_NAMES
from weldsim.records import JointTrajectory, Segment

CONNECT_TIMEOUT = 30.0  # [s] a client process may be long in coming where others keep the machine busy
PATIENT = {"connect_timeout": CONNECT_TIMEOUT, "watchdog_rate": 2.0, "stall": 0.4, "answer_timeout": 0.4, "silence": 1.0}
"""Settings of a robot that a busy machine does not stop at once, for tests of what it does while it is not stopped."""
SPEED, ACCELERATION = 2.0, 6.0  # [rad/s], [rad/s2] of the way to where a test begins


@contextmanager
def controlled(series: Series, *options: str) -> Iterator[str]:
    """The address of a controller of a series, until the block ends."""
    with served("--profile", series, *options) as host:
        yield host


def place(host: str, q: ndarray) -> None:
    """The arm at rest at q, nothing running and nothing wrong."""
    ask(host, {"fault": "recover"})
    program = f"def go():\n  movej([{', '.join(f'{x:.9f}' for x in q)}], a={ACCELERATION}, v={SPEED})\nend\n"
    with socket.create_connection((host, REALTIME), PATIENCE) as sock:
        sock.sendall(program.encode())
        assert wait_for(lambda: _there(host, q))


def _there(host: str, q: ndarray) -> bool:
    now = ask(host, {"status": True})
    return not now["program"] and bool(np.abs(np.array(now["q"]) - q).max() < 5e-4)


def ur_robot(host: str, q: ndarray | None = None) -> UrRobot:
    """A patient UrRobot, not connected, whose arm rests at q; where it is, without one."""
    if q is not None:
        place(host, q)
    return UrRobot(UrConfig(host=host, **PATIENT))


def weld(q: ndarray, period: float, seconds: float = 5.0, reach: float = 0.3) -> JointTrajectory:
    """A weld from q and back by the first joint, `reach` rad wide, the arc on from 0.1 s."""
    t = np.arange(0.0, seconds, period)
    sine, cosine = np.sin(np.pi * t / seconds), np.cos(np.pi * t / seconds)  # its fourth power begins without a jerk
    swing, zeros = np.array([1.0, 0, 0, 0, 0, 0]), np.zeros((len(t), 6))
    return JointTrajectory(
        t=t,
        q=q + reach * sine[:, None] ** 4 * swing,
        qd=reach * 4 * np.pi / seconds * (sine**3 * cosine)[:, None] * swing,
        qdd=zeros,
        s=0.01 * t,
        arc_on=t > 0.1,
        segments=(Segment.WELD,) * len(t),
        joint_names=JOINT_NAMES,
    )
