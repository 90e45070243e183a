"""Functions about time, messages and supervision."""

from collections.abc import Iterator
from typing import Any

from weldsim.controller.inputs import input_type
from weldsim.controller.machine import Machine
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.strings import to_text
from weldsim.urscript.values import number


class SystemFunctions:
    """sync, sleep, textmsg, popup, watchdogs and stops."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def sync(self) -> Iterator[None]:
        """The rest of this control period."""
        yield

    def sleep(self, t: float) -> Iterator[None]:
        """t [s] of waiting, one control period at least."""
        for _ in range(max(1, round(number(t) / self._machine.profile.period))):
            yield

    def get_steptime(self) -> float:
        """Control period [s]."""
        return self._machine.profile.period

    def textmsg(self, s1: Any, s2: Any = "") -> None:
        """A line in the log."""
        self._machine.say(f"{to_text(s1)}{to_text(s2)}")

    def popup(
        self, s: Any, title: str = "Popup", warning: bool = False, error: bool = False, blocking: bool = False
    ) -> Iterator[None]:
        """A message on the pendant; with blocking it waits for `close popup` on the dashboard."""
        self._machine.popup = to_text(s)
        self._machine.say(f"{title}: {to_text(s)}")
        while blocking and self._machine.popup:
            yield

    def rtde_set_watchdog(self, variable_name: str, min_frequency: float, action: str = "pause") -> None:
        """Pause or stop the program when an RTDE input is updated less often than min_frequency [Hz]; 0 lifts it."""
        if action.lower() not in ("pause", "stop", "ignore"):
            raise ScriptError(f"rtde_set_watchdog: action {action!r} is none of pause, stop, ignore")
        if input_type(variable_name) is None:
            raise ScriptError(f"rtde_set_watchdog: there is no input {variable_name!r}")
        self._machine.watchdogs.set(variable_name, number(min_frequency), action.lower(), self._machine.t)

    def protective_stop(self) -> Iterator[None]:
        """Stop the arm as after a collision."""
        self._machine.protective_stop("asked for by the program")
        yield

    def powerdown(self) -> None:
        """Nothing: the virtual controller stays on."""
