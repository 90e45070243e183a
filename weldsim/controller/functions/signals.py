"""Functions about registers and digital and analog signals."""

from typing import Any

from weldsim.controller.machine import Machine
from weldsim.controller.registers import BITS, DOUBLES, INTEGERS
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import number, type_name


class SignalFunctions:
    """What programs exchange with RTDE clients and with what is wired to the controller."""

    def __init__(self, machine: Machine) -> None:
        self._io = machine.io

    def read_input_integer_register(self, address: int) -> int:
        return self._io.in_int[one_of(address, INTEGERS)]

    def read_input_float_register(self, address: int) -> float:
        return self._io.in_double[one_of(address, DOUBLES)]

    def read_input_boolean_register(self, address: int) -> bool:
        return self._io.in_bit[one_of(address, BITS)]

    def read_output_integer_register(self, address: int) -> int:
        return self._io.out_int[one_of(address, INTEGERS)]

    def read_output_float_register(self, address: int) -> float:
        return self._io.out_double[one_of(address, DOUBLES)]

    def read_output_boolean_register(self, address: int) -> bool:
        return self._io.out_bit[one_of(address, BITS)]

    def write_output_integer_register(self, address: int, value: int) -> None:
        """A whole number of 32 bits, signed."""
        if number(value) != int(value) or not -(2**31) <= value < 2**31:
            raise ScriptError(f"write_output_integer_register: {value} is not a whole number of 32 bits")
        self._io.out_int[one_of(address, INTEGERS)] = int(value)

    def write_output_float_register(self, address: int, value: float) -> None:
        self._io.out_double[one_of(address, DOUBLES)] = float(number(value))

    def write_output_boolean_register(self, address: int, value: bool) -> None:
        self._io.out_bit[one_of(address, BITS)] = _flag(value)

    def get_standard_digital_in(self, n: int) -> bool:
        return self._input(n, 8, 0)

    def get_configurable_digital_in(self, n: int) -> bool:
        return self._input(n, 8, 8)

    def get_tool_digital_in(self, n: int) -> bool:
        return self._input(n, 2, 16)

    def get_digital_in(self, n: int) -> bool:
        """0-7 standard, 8-15 configurable, 16-17 tool."""
        return self._input(n, 18, 0)

    def get_standard_digital_out(self, n: int) -> bool:
        return self._output(n, 8, 0)

    def get_configurable_digital_out(self, n: int) -> bool:
        return self._output(n, 8, 8)

    def get_tool_digital_out(self, n: int) -> bool:
        return self._output(n, 2, 16)

    def get_digital_out(self, n: int) -> bool:
        """0-7 standard, 8-15 configurable, 16-17 tool."""
        return self._output(n, 18, 0)

    def set_standard_digital_out(self, n: int, b: bool) -> None:
        self._io.set_digital_out(one_of(n, 8), _flag(b))

    def set_configurable_digital_out(self, n: int, b: bool) -> None:
        self._io.set_digital_out(8 + one_of(n, 8), _flag(b))

    def set_tool_digital_out(self, n: int, b: bool) -> None:
        self._io.set_digital_out(16 + one_of(n, 2), _flag(b))

    def set_digital_out(self, n: int, b: bool) -> None:
        """0-7 standard, 8-15 configurable, 16-17 tool."""
        self._io.set_digital_out(one_of(n, 18), _flag(b))

    def get_standard_analog_in(self, n: int) -> float:
        """Volts or amperes as the channel is set."""
        return self._io.analog_in[one_of(n, 2)]

    def get_standard_analog_out(self, n: int) -> float:
        """Volts or amperes as the channel is set."""
        return self._io.analog_out[one_of(n, 2)]

    def set_standard_analog_out(self, n: int, f: float) -> None:
        """A share of the range, 0 to 1."""
        self._io.set_analog_out(one_of(n, 2), number(f))

    def set_analog_out(self, n: int, f: float) -> None:
        """A share of the range, 0 to 1."""
        self.set_standard_analog_out(n, f)

    def set_analog_outputdomain(self, port: int, domain: int) -> None:
        """0 for a current, 1 for a voltage."""
        channel = one_of(port, 2)
        self._io.set_analog_out(channel, 0.0, bool(number(domain)))

    def _input(self, n: Any, size: int, first: int) -> bool:
        return bool(self._io.digital_in >> first + one_of(n, size) & 1)

    def _output(self, n: Any, size: int, first: int) -> bool:
        return bool(self._io.digital_out >> first + one_of(n, size) & 1)


def one_of(value: Any, size: int) -> int:
    """A whole number from 0 to size - 1. Raises ScriptError."""
    if number(value) != int(value) or not 0 <= value < size:
        raise ScriptError(f"address {value} is not one of 0 to {size - 1}")
    return int(value)


def _flag(value: Any) -> bool:
    if type(value) is not bool:
        raise ScriptError(f"expected True or False, not {type_name(value)}")
    return value
