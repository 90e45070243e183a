"""How the tours of a controller wait: for what has come in, on the controller's clock, and for no moment of the machine's.

A client's streams do not tell at once: the control interface may know of a move's end before the receive interface does.
"""

from collections.abc import Callable

import rtde_receive

from tests.controllers import wait_for
from weldsim.controller.ask import ask

STEP = 0.002  # [s] between two looks
TICK = 1e-4  # [s] less than a control period


class Receiver(rtde_receive.RTDEReceiveInterface):
    """The client's receive interface, which knows whose it is. Attributes: host."""

    def __init__(self, host: str) -> None:
        super().__init__(host)
        self.host = host


def until(condition: Callable[[], object]) -> bool:
    """Whether it came true within PATIENCE."""
    return wait_for(condition, step=STEP)


def later(receive: Receiver, seconds: float) -> Receiver:
    """The interface, once it has heard of a time that many seconds [s] of the controller's after this one."""
    end = float(ask(receive.host, {"status": True})["t"]) + seconds + TICK
    if not until(lambda: receive.getTimestamp() > end):
        raise TimeoutError(f"no report of {end:.3f} s came")
    return receive


def told(receive: Receiver) -> Receiver:
    """The interface, once it has heard of what the controller knows by now.

    What the IO interface sends may be on its way still: its small packets wait for one another, 40 ms (Nagle's algorithm).
    """
    return later(receive, 0.0)


def away(a: list[float], b: list[float]) -> float:
    """The greatest difference of two lists."""
    return max(abs(x - y) for x, y in zip(a, b, strict=True))
