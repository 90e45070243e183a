"""What this machine did to a test: for how long it kept the process waiting, so that a product is judged and not a busy machine."""

import functools
import threading
import time
from collections.abc import Callable
from typing import ParamSpec, TypeVar

P, T = ParamSpec("P"), TypeVar("T")

STEP = 0.005  # [s] between two looks
USUAL = 0.002  # [s] by which a sleep may end late
HELD_UP = 0.08  # [s] a stream of commands is stopped after 0.12 s: a machine that keeps a thread waiting so long is no proof
ATTEMPTS = 6


class Watch:
    """A thread that sleeps in short steps, while a `with` block lasts: what is more was the machine's.

    Attributes:
        lost: time [s] that was lost so far.  worst: the longest of it at once [s].
    """

    def __init__(self) -> None:
        self.lost = self.worst = 0.0
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def _look(self) -> None:
        while not self._done.is_set():
            began = time.monotonic()
            time.sleep(STEP)
            late = time.monotonic() - began - STEP
            if late > USUAL:
                self.lost += late
                self.worst = max(self.worst, late)

    def clock(self) -> float:
        """Monotonic time [s] without what was lost."""
        return time.monotonic() - self.lost

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()


def unless_held_up(test: Callable[P, T]) -> Callable[P, T]:
    """The test, begun again where it fails and the machine held it up meanwhile: a stream of commands that a machine holds up is
    stopped, and rightly. What fails on a machine that does not, or in every attempt, fails."""

    @functools.wraps(test)
    def patient(*args: P.args, **kwargs: P.kwargs) -> T:
        for _ in range(ATTEMPTS - 1):
            with Watch() as watch:
                try:
                    return test(*args, **kwargs)
                except Exception:
                    if watch.worst < HELD_UP:
                        raise
        return test(*args, **kwargs)

    return patient
