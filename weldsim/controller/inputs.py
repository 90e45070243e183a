"""What RTDE clients can write: each variable's type, who has claimed it, and what a packet of values does."""

import re
from collections.abc import Sequence
from typing import Any

from weldsim.controller.registers import BITS, DOUBLES, INTEGERS, Registers
from weldsim.execution.rtde_packet import unpack_values

_FIXED = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "standard_digital_output_mask": "UINT8",
    "standard_digital_output": "UINT8",
    "configurable_digital_output_mask": "UINT8",
    "configurable_digital_output": "UINT8",
    "tool_digital_output_mask": "UINT8",
    "tool_digital_output": "UINT8",
    "standard_analog_output_mask": "UINT8",
    "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE",
    "standard_analog_output_1": "DOUBLE",
    "input_bit_registers0_to_31": "UINT32",
    "input_bit_registers32_to_63": "UINT32",
    "external_force_torque": "VECTOR6D",
}
_NUMBERED = re.compile(r"input_(bit|int|double)_register_(\d+)")
_BANKS: dict[str, tuple[str, int, int]] = {
    "bit": ("BOOL", 64, BITS),
    "int": ("INT32", 0, INTEGERS),
    "double": ("DOUBLE", 0, DOUBLES),
}
_DIGITAL = {"standard_digital_output": (0, 0xFF), "configurable_digital_output": (8, 0xFF), "tool_digital_output": (16, 0b11)}
"""First bit of each group of outputs, and which of the bits of its mask there are."""


def input_type(name: str) -> str | None:
    """RTDE type of an input variable, or None where there is none of that name."""
    if (match := _NUMBERED.fullmatch(name)) is not None:
        kind, low, high = _BANKS[match[1]]
        return kind if low <= int(match[2]) < high else None
    return _FIXED.get(name)


class InputRecipe:
    """What one client writes together.

    Attributes:
        names: the variables.  types: as the set-up reply says them: NOT_FOUND, IN_USE where another client holds it.
        complete: whether every variable is there and free.
    """

    def __init__(self, names: Sequence[str], claimed: set[str]) -> None:
        """Args: names; claimed: variables that other clients hold."""
        self.names = tuple(names)
        self.types = ["IN_USE" if name in claimed else input_type(name) or "NOT_FOUND" for name in names]
        self.complete = not {"IN_USE", "NOT_FOUND"} & set(self.types)

    def apply(self, payload: bytes, io: Registers) -> None:
        """Write the values of one packet. Raises ProtocolError where they do not fit the recipe."""
        values = dict(zip(self.names, unpack_values(self.types, payload), strict=True))
        for name, value in values.items():
            if (match := _NUMBERED.fullmatch(name)) is not None:
                getattr(io, f"in_{match[1]}")[int(match[2])] = value
            elif name.startswith("input_bit_registers"):
                first = 0 if name.endswith("31") else 32
                io.in_bit[first : first + 32] = [bool(value >> k & 1) for k in range(32)]
        for name, (shift, there) in _DIGITAL.items():
            if name in values:
                io.mask_digital_out(shift, values.get(f"{name}_mask", 0) & there, values[name])
        if values.get("speed_slider_mask", 0):
            io.slider = min(1.0, max(0.0, values.get("speed_slider_fraction", io.slider)))
        _apply_analog(values, io)


def _apply_analog(values: dict[str, Any], io: Registers) -> None:
    """The channels that the mask names: type bit 1 is a voltage, value a share of the range."""
    mask, voltage = values.get("standard_analog_output_mask", 0), values.get("standard_analog_output_type", 0)
    for channel in (0, 1):
        if mask >> channel & 1 and f"standard_analog_output_{channel}" in values:
            io.set_analog_out(channel, values[f"standard_analog_output_{channel}"], bool(voltage >> channel & 1))
