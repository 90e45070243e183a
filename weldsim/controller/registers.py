"""What RTDE clients and programs exchange: general purpose registers, digital and analog signals, the speed slider."""

from dataclasses import dataclass, field

INTEGERS, DOUBLES, BITS = 48, 48, 128


def _zeros(n: int) -> list[float]:
    return [0.0] * n


@dataclass(eq=False)
class Registers:
    """All of them, as they are now; they outlive programs and connections.

    Attributes:
        in_bit, in_int, in_double: written by RTDE clients, read by programs.
        out_bit, out_int, out_double: written by programs, read by RTDE clients.
        digital_in, digital_out: bit masks; bits 0-7 standard, 8-15 configurable, 16-17 tool.
        analog_in, analog_out: two standard channels each, [V] or [A] as their domain says.
        analog_in_domain, analog_out_domain: bit k: channel k is a voltage (1) or a current (0).
        slider: the speed slider, 0 to 1.  tool_voltage: at the tool connector [V].
    """

    in_bit: list[bool] = field(default_factory=lambda: [False] * BITS)
    in_int: list[int] = field(default_factory=lambda: [0] * INTEGERS)
    in_double: list[float] = field(default_factory=lambda: _zeros(DOUBLES))
    out_bit: list[bool] = field(default_factory=lambda: [False] * BITS)
    out_int: list[int] = field(default_factory=lambda: [0] * INTEGERS)
    out_double: list[float] = field(default_factory=lambda: _zeros(DOUBLES))
    digital_in: int = 0
    digital_out: int = 0
    analog_in: list[float] = field(default_factory=lambda: _zeros(2))
    analog_out: list[float] = field(default_factory=lambda: _zeros(2))
    analog_in_domain: int = 3
    analog_out_domain: int = 0
    slider: float = 1.0
    tool_voltage: int = 0

    def set_digital_out(self, bit: int, on: bool) -> None:
        """Switch one output; bit 0-17 as in `digital_out`."""
        self.digital_out = self.digital_out | 1 << bit if on else self.digital_out & ~(1 << bit)

    def mask_digital_out(self, shift: int, mask: int, value: int) -> None:
        """Set the outputs that `mask` names to `value`, both counted from bit `shift`."""
        self.digital_out = self.digital_out & ~(mask << shift) | (mask & value) << shift

    def set_analog_out(self, channel: int, share: float, voltage: bool | None = None) -> None:
        """Set a channel to a share of its range, 0-10 V or 4-20 mA; the domain stays where `voltage` is None."""
        if voltage is not None:
            self.analog_out_domain = self.analog_out_domain & ~(1 << channel) | int(voltage) << channel
        share = min(1.0, max(0.0, share))
        is_voltage = self.analog_out_domain >> channel & 1
        self.analog_out[channel] = 10.0 * share if is_voltage else 0.004 + 0.016 * share
