"""What RTDE clients can read: each variable's type and where its value comes from (UR RTDE guide, controller outputs)."""

import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from weldsim.controller.profile import Profile
from weldsim.controller.registers import BITS, DOUBLES, INTEGERS
from weldsim.execution.rtde_packet import layout, width

if TYPE_CHECKING:
    from weldsim.controller.snapshot import Snapshot

Getter = Callable[["Snapshot"], Any]
"""A number, or a sequence where the type is a vector."""

ZERO6 = (0.0,) * 6

_FIXED: dict[str, tuple[str, Getter]] = {
    "timestamp": ("DOUBLE", lambda s: s.t),
    "target_q": ("VECTOR6D", lambda s: s.q_target),
    "target_qd": ("VECTOR6D", lambda s: s.qd_target),
    "target_qdd": ("VECTOR6D", lambda s: s.qdd_target),
    "target_current": ("VECTOR6D", lambda s: s.current),
    "target_moment": ("VECTOR6D", lambda s: s.torque),
    "actual_q": ("VECTOR6D", lambda s: s.q),
    "actual_qd": ("VECTOR6D", lambda s: s.qd),
    "actual_current": ("VECTOR6D", lambda s: s.current),
    "actual_current_window": ("VECTOR6D", lambda s: ZERO6),
    "joint_control_output": ("VECTOR6D", lambda s: s.current),
    "actual_TCP_pose": ("VECTOR6D", lambda s: s.tcp_pose),
    "actual_TCP_speed": ("VECTOR6D", lambda s: s.tcp_speed),
    "actual_TCP_force": ("VECTOR6D", lambda s: ZERO6),
    "target_TCP_pose": ("VECTOR6D", lambda s: s.tcp_pose_target),
    "target_TCP_speed": ("VECTOR6D", lambda s: s.tcp_speed_target),
    "tcp_offset": ("VECTOR6D", lambda s: s.tcp_offset),
    "actual_digital_input_bits": ("UINT64", lambda s: s.io.digital_in),
    "joint_temperatures": ("VECTOR6D", lambda s: (30.0,) * 6),
    "actual_execution_time": ("DOUBLE", lambda s: s.busy),
    "robot_mode": ("INT32", lambda s: s.robot_mode),
    "joint_mode": ("VECTOR6INT32", lambda s: (s.joint_mode,) * 6),
    "safety_mode": ("INT32", lambda s: s.safety_mode),
    "safety_status": ("INT32", lambda s: s.safety_mode),
    "actual_tool_accelerometer": ("VECTOR3D", lambda s: s.tool_acceleration),
    "speed_scaling": ("DOUBLE", lambda s: s.speed_scaling),
    "target_speed_fraction": ("DOUBLE", lambda s: s.io.slider),
    "actual_momentum": ("DOUBLE", lambda s: 0.0),
    "tcp_force_scalar": ("DOUBLE", lambda s: 0.0),
    "actual_main_voltage": ("DOUBLE", lambda s: 48.0),
    "actual_robot_voltage": ("DOUBLE", lambda s: s.voltage),
    "actual_robot_current": ("DOUBLE", lambda s: s.robot_current),
    "actual_joint_voltage": ("VECTOR6D", lambda s: (s.voltage,) * 6),
    "actual_digital_output_bits": ("UINT64", lambda s: s.io.digital_out),
    "runtime_state": ("UINT32", lambda s: s.runtime_state),
    "elbow_position": ("VECTOR3D", lambda s: s.elbow),
    "elbow_velocity": ("VECTOR3D", lambda s: s.elbow_speed),
    "robot_status_bits": ("UINT32", lambda s: s.status_bits),
    "safety_status_bits": ("UINT32", lambda s: s.safety_bits),
    "analog_io_types": ("UINT32", lambda s: s.io.analog_in_domain | s.io.analog_out_domain << 2),
    "standard_analog_input0": ("DOUBLE", lambda s: s.io.analog_in[0]),
    "standard_analog_input1": ("DOUBLE", lambda s: s.io.analog_in[1]),
    "standard_analog_output0": ("DOUBLE", lambda s: s.io.analog_out[0]),
    "standard_analog_output1": ("DOUBLE", lambda s: s.io.analog_out[1]),
    "io_current": ("DOUBLE", lambda s: 0.0),
    "euromap67_input_bits": ("UINT32", lambda s: 0),
    "euromap67_output_bits": ("UINT32", lambda s: 0),
    "euromap67_24V_voltage": ("DOUBLE", lambda s: 0.0),
    "euromap67_24V_current": ("DOUBLE", lambda s: 0.0),
    "tool_mode": ("UINT32", lambda s: s.joint_mode),
    "tool_analog_input_types": ("UINT32", lambda s: 3),
    "tool_analog_input0": ("DOUBLE", lambda s: 0.0),
    "tool_analog_input1": ("DOUBLE", lambda s: 0.0),
    "tool_output_voltage": ("INT32", lambda s: s.io.tool_voltage),
    "tool_output_current": ("DOUBLE", lambda s: 0.0),
    "tool_temperature": ("DOUBLE", lambda s: 30.0),
    "tool_output_mode": ("UINT8", lambda s: 0),
    "tool_digital_output0_mode": ("UINT8", lambda s: 0),
    "tool_digital_output1_mode": ("UINT8", lambda s: 0),
    "output_bit_registers0_to_31": ("UINT32", lambda s: _mask(s.io.out_bit, 0)),
    "output_bit_registers32_to_63": ("UINT32", lambda s: _mask(s.io.out_bit, 32)),
    "input_bit_registers0_to_31": ("UINT32", lambda s: _mask(s.io.in_bit, 0)),
    "input_bit_registers32_to_63": ("UINT32", lambda s: _mask(s.io.in_bit, 32)),
    "payload": ("DOUBLE", lambda s: s.payload),
    "payload_cog": ("VECTOR3D", lambda s: s.payload_cog),
    "payload_inertia": ("VECTOR6D", lambda s: s.payload_inertia),
    "script_control_line": ("UINT32", lambda s: 0),
    "joint_position_deviation_ratio": ("DOUBLE", lambda s: 0.0),
    "collision_detection_ratio": ("DOUBLE", lambda s: 0.0),
    "ft_raw_wrench": ("VECTOR6D", lambda s: ZERO6),
}
_E_ONLY = {
    "ft_raw_wrench",
    "actual_current_window",
    "joint_position_deviation_ratio",
    "collision_detection_ratio",
    "tool_output_mode",
    "tool_digital_output0_mode",
    "tool_digital_output1_mode",
}
_NUMBERED = re.compile(r"(input|output)_(bit|int|double)_register_(\d+)")
_BANKS: dict[str, tuple[str, int, int]] = {
    "bit": ("BOOL", 64, BITS),
    "int": ("INT32", 0, INTEGERS),
    "double": ("DOUBLE", 0, DOUBLES),
}


def _mask(bits: Sequence[bool], first: int) -> int:
    return sum(1 << k for k in range(32) if bits[first + k])


def find_output(name: str, profile: Profile) -> tuple[str, Getter] | None:
    """Type and source of a variable, or None where this controller has none of that name."""
    if name in _FIXED:
        return None if profile.series == "cb3" and name in _E_ONLY else _FIXED[name]
    if (match := _NUMBERED.fullmatch(name)) is None:
        return None
    side, bank, index = match[1], match[2], int(match[3])
    kind, low, high = _BANKS[bank]
    if not low <= index < high:
        return None
    attribute = f"{'in' if side == 'input' else 'out'}_{bank}"
    return kind, lambda s: getattr(s.io, attribute)[index]


class OutputRecipe:
    """What one client asked for, ready to be packed.

    Attributes:
        types: as the set-up reply says them, NOT_FOUND for a variable that is not there.
        complete: whether all are there; a client with a recipe that is not cannot start.
        every: cycles of control from one packet to the next: the control frequency over the asked one, rounded down (UR RTDE
            guide, set-up of outputs), so that a client never gets fewer packets than it asked for.
    """

    def __init__(self, names: Sequence[str], frequency: float, profile: Profile) -> None:
        found = [find_output(name, profile) for name in names]
        self.types = ["NOT_FOUND" if entry is None else entry[0] for entry in found]
        self.complete = None not in found
        self.every = max(1, int(profile.frequency / frequency + 1e-9)) if frequency > 0 else 1
        entries = [entry for entry in found if entry is not None]
        self._layout = layout(tuple(kind for kind, _ in entries))
        self._sources = [(width(kind) > 1, getter) for kind, getter in entries]

    def pack(self, snapshot: "Snapshot") -> bytes:
        """The values now, without recipe number."""
        values: list[Any] = []
        for vector, getter in self._sources:
            if vector:
                values.extend(getter(snapshot))
            else:
                values.append(getter(snapshot))
        return self._layout.pack(*values)
