"""Functions with which programs that PolyScope wrote begin: what the installation says of signals, and flags.

What the twin has no part for is checked, accepted and without effect.
"""

from typing import Any

from weldsim.controller.functions.signals import one_of
from weldsim.controller.machine import Machine
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import number

TOOL_VOLTAGES = (0, 12, 24)  # [V]
FLAGS = 32


class InstallationFunctions:
    """Domains of analog inputs, the tool's voltage, actions of inputs and outputs, flags."""

    def __init__(self, machine: Machine) -> None:
        self._io = machine.io
        self._flags = [False] * FLAGS

    def set_standard_analog_input_domain(self, port: int, domain: int) -> None:
        """0 for a current, 1 for a voltage."""
        channel = one_of(port, 2)
        self._io.analog_in_domain = self._io.analog_in_domain & ~(1 << channel) | one_of(domain, 2) << channel

    def set_tool_analog_input_domain(self, port: int, domain: int) -> None:
        """Nothing, after the arguments have been checked."""
        one_of(port, 2)
        one_of(domain, 2)

    def set_analog_inputrange(self, port: int, range: int) -> None:
        """Nothing, after the arguments have been checked: 0 and 1 the box's, 2 and 3 the tool's."""
        one_of(port, 4)
        number(range)

    def set_tool_voltage(self, voltage: int) -> None:
        """0, 12 or 24 [V] at the tool connector."""
        if number(voltage) not in TOOL_VOLTAGES:
            raise ScriptError(f"set_tool_voltage: {voltage} V is none of 0, 12, 24")
        self._io.tool_voltage = int(voltage)

    def get_tool_analog_in(self, n: int) -> float:
        """0: nothing is wired to the tool."""
        one_of(n, 2)
        return 0.0

    def get_tool_current(self) -> float:
        """0 [A]: nothing is wired to the tool."""
        return 0.0

    def set_flag(self, n: int, b: bool) -> None:
        """One of 32 flags, which last until the controller is switched off."""
        if type(b) is not bool:
            raise ScriptError("set_flag: expected True or False")
        self._flags[one_of(n, FLAGS)] = b

    def get_flag(self, n: int) -> bool:
        return self._flags[one_of(n, FLAGS)]

    def set_input_actions_to_default(self) -> None:
        """Nothing: inputs have no actions."""

    def set_standard_digital_input_action(self, port: int, action: str) -> None:
        """Nothing: inputs have no actions."""

    def set_configurable_digital_input_action(self, port: int, action: str) -> None:
        """Nothing: inputs have no actions."""

    def set_tool_digital_input_action(self, port: int, action: str) -> None:
        """Nothing: inputs have no actions."""

    def set_safety_mode_transition_hardness(self, type: int) -> None:
        """Nothing: there is no reduced mode to change to."""

    def set_runstate_standard_digital_output_to_value(self, outputId: int, state: int) -> None:
        """Nothing: which outputs drop when no program runs is set where the controller is started."""

    def set_runstate_configurable_digital_output_to_value(self, outputId: int, state: int) -> None:
        """Nothing: which outputs drop when no program runs is set where the controller is started."""

    def set_runstate_tool_digital_output_to_value(self, outputId: int, state: int) -> None:
        """Nothing: which outputs drop when no program runs is set where the controller is started."""

    def reset_world_model(self) -> Any:
        """Nothing: there is no world model."""
