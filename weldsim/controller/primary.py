"""The primary and secondary interfaces, ports 30001 and 30002: programs in, and ten times a second the controller's state.

Time is the wall clock's, whatever `speed`: who waits for a first state does so in seconds. The first comes a tenth of a second
after the connection: who sends a program and hangs up at once is gone by then, and leaves nothing unread that would take the
program with it.
"""

import time

from weldsim.controller.machine import Machine
from weldsim.controller.script_port import ScriptSession
from weldsim.controller.state_message import state_message, version_message

PERIOD = 0.1  # [s]


class PrimarySession(ScriptSession):
    """One client: a script session that is told of the arm."""

    def __init__(self, machine: Machine) -> None:
        super().__init__(machine)
        self._due, self._told = time.perf_counter() + PERIOD, False

    def data(self) -> bytes:
        """The message that is due after one more control period, or nothing."""
        now = time.perf_counter()
        if now < self._due:
            return b""
        self._due = now + PERIOD
        first, self._told = not self._told, True
        return (version_message(self._machine) if first else b"") + state_message(self._machine)
