"""Real-time priority: taken while a stream lasts and given back, by whichever thread ends it."""

import os
import threading

import pytest

from weldsim.execution.priority import Haste, hurry


def policy_in_thread(work: list) -> list[int]:
    """This thread's policy after each of `work`, in a thread of its own: its priority ends with it."""
    found: list[int] = []

    def run() -> None:
        for step in work:
            step()
            found.append(os.sched_getscheduler(0))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return found


def allowed() -> bool:
    return policy_in_thread([hurry]) == [os.SCHED_RR]


def test_it_lasts_from_begin_to_end() -> None:
    haste = Haste()
    hurried = os.SCHED_RR if allowed() else os.SCHED_OTHER
    assert policy_in_thread([haste.end, haste.begin, haste.begin, haste.end, haste.end, haste.begin]) == [
        os.SCHED_OTHER,
        hurried,
        hurried,
        os.SCHED_OTHER,
        os.SCHED_OTHER,
        hurried,
    ]
    haste.end()  # its thread has ended: nothing
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_another_thread_may_end_it() -> None:
    haste = Haste()
    haste.begin()
    policy_in_thread([haste.end])
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_without_permission_everything_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> None:
        raise PermissionError("not allowed")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    haste = Haste()
    haste.begin()
    hurry()
    haste.end()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
