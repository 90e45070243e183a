"""Real-time priority for threads that must not be late, where the system allows it (root, CAP_SYS_NICE or an rtprio limit)."""

import os
import threading
from contextlib import suppress

LOWEST = 1  # of the real-time priorities: above every ordinary thread, below what the system itself runs so


def hurry() -> None:
    """Ask for real-time priority for this thread, from now on; it goes without where that is not allowed.

    Only for threads that sleep most of the time: an ordinary thread runs on the same core only while they do.
    """
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(LOWEST))


class Haste:
    """Real-time priority for whichever thread calls `begin`, until `end`, from any thread, gives it back what it had."""

    def __init__(self) -> None:
        self._before: tuple[int, int, int] | None = None  # thread, its policy and priority

    def begin(self) -> None:
        """Again while it lasts: nothing."""
        if self._before is not None:
            return
        with suppress(OSError, AttributeError):
            self._before = threading.get_native_id(), os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
            if self._before[1] == os.SCHED_OTHER:
                hurry()

    def end(self) -> None:
        """Without `begin`: nothing."""
        if self._before is None:
            return
        (thread, policy, priority), self._before = self._before, None
        with suppress(OSError, AttributeError):  # the thread may have ended
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
