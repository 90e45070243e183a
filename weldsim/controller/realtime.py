"""The real-time interface, port 30003: programs in, and after every control period one packet of figures, all of them doubles.

Layout: the manufacturer's table of the real-time client interface. The length tells a client which edition it reads: 1060 bytes
up to the program state, 1108 with the elbow, 1116 with the safety status, 1140 with three for the manufacturer's own use, 1220
with the payload. The last is sent on both series: 5.11 has it, and 3.15 is its counterpart, as in the RTDE interface.
"""

import struct
import time

from weldsim.controller.machine import Machine
from weldsim.controller.script_port import ScriptSession
from weldsim.controller.snapshot import Snapshot

SILENCE = 0.1  # [s] of the wall clock after the connection, for the same reason as on the primary interface
LENGTH = 1220
_PACKET = struct.Struct(">i152d")
_ZERO3, _ZERO6 = (0.0,) * 3, (0.0,) * 6
_WARM = (30.0,) * 6  # [degree Celsius]
MAIN_VOLTAGE = 48.0  # [V]


def realtime_packet(now: Snapshot) -> bytes:
    """The 1220 bytes that tell of one control period."""
    return _PACKET.pack(
        LENGTH,
        now.t,
        *now.q_target,
        *now.qd_target,
        *now.qdd_target,
        *now.current,  # target
        *now.torque,  # target
        *now.q,
        *now.qd,
        *now.current,
        *now.current,  # control
        *now.tcp_pose,
        *now.tcp_speed,
        *_ZERO6,  # TCP force
        *now.tcp_pose_target,
        *now.tcp_speed_target,
        now.io.digital_in,
        *_WARM,
        now.busy,
        0.0,  # test value
        now.robot_mode,
        *(now.joint_mode,) * 6,
        now.safety_mode,
        *_ZERO6,
        *now.tool_acceleration,
        *_ZERO6,
        now.speed_scaling,
        *_ZERO3,  # momentum, and two for the manufacturer's own use
        MAIN_VOLTAGE,
        now.voltage,
        now.robot_current,
        *(now.voltage,) * 6,
        now.io.digital_out,
        now.runtime_state,
        *now.elbow,
        *now.elbow_speed,
        now.safety_mode,  # safety status
        *_ZERO3,
        now.payload,
        *now.payload_cog,
        *now.payload_inertia,
    )


class RealtimeSession(ScriptSession):
    """One client: a script session that is told of every control period.

    Attributes:
        send_buffer: of its socket [byte]. ur_rtde sends its programs here and never reads: packets are made for it no longer than
            half a second.
    """

    send_buffer = 1 << 16

    def __init__(self, machine: Machine) -> None:
        super().__init__(machine)
        self._since = time.perf_counter() + SILENCE

    def data(self) -> bytes:
        """The packet of the last control period, or nothing in the first tenth of a second."""
        return b"" if time.perf_counter() < self._since else realtime_packet(self._machine.snapshot)
