"""The primary interface, port 30001: programs in, and ten times a second what the arm is, as far as it is modelled.

A real controller sends a dozen sub-packages. Here it is two, the mode and the arm's kinematics, after one version message; a
client has to skip what it does not want by the sizes, as with the real one. Time is the wall clock's, whatever `speed`: who waits
for a first state does so in seconds. The first comes a tenth of a second after the connection: who sends a program and hangs up
at once is gone by then, and leaves nothing unread that would take the program with it.
"""

import struct
import time

from weldsim.controller.machine import Machine
from weldsim.controller.script_port import ScriptSession
from weldsim.execution.primary_packet import KINEMATICS_INFO, MODE_DATA, ROBOT_MESSAGE, ROBOT_STATE, KinematicsInfo, framed
from weldsim.execution.ur_modes import RuntimeState, SafetyMode

PERIOD = 0.1  # [s]
VERSION_MESSAGE = 3
PROJECT = b"URControl"
_MODE = struct.Struct(">Q7BBBdddB")
_EMERGENCY = (SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SYSTEM_EMERGENCY_STOP)


class PrimarySession:
    """One client: a script session that is told of the arm."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._script = machine, ScriptSession(machine)
        self._due, self._told = time.perf_counter() + PERIOD, False

    def greeting(self) -> bytes:
        return b""

    def ended(self) -> None:
        self._script.ended()

    def received(self, data: bytes) -> bytes:
        return self._script.received(data)

    def data(self) -> bytes:
        """The message that is due after one more control period, or nothing."""
        now = time.perf_counter()
        if now < self._due:
            return b""
        self._due = now + PERIOD
        first, self._told = not self._told, True
        return (self._version() if first else b"") + self._state()

    def _version(self) -> bytes:
        major, minor, bugfix, build = self._machine.profile.version
        date = self._machine.profile.software.partition("(")[2].rstrip(")").encode()
        head = struct.pack(">QbBB", 0, -2, VERSION_MESSAGE, len(PROJECT))
        return framed(ROBOT_MESSAGE, head + PROJECT + struct.pack(">BBii", major, minor, bugfix, build) + date)

    def _state(self) -> bytes:
        machine = self._machine
        info = KinematicsInfo(machine.kinematics.dh, machine.config.calibration.calibration_status)
        return framed(ROBOT_STATE, framed(MODE_DATA, self._mode()) + framed(KINEMATICS_INFO, info.encode()))

    def _mode(self) -> bytes:
        """Flags of one byte each: connected, enabled, powered, emergency stop, protective stop, program running, paused."""
        machine = self._machine
        now = machine.snapshot
        flags = (
            1,
            1,
            now.status_bits & 1,
            machine.safety_mode in _EMERGENCY,
            machine.safety_mode is SafetyMode.PROTECTIVE_STOP,
            machine.runtime is RuntimeState.PLAYING,
            machine.runtime is RuntimeState.PAUSED,
        )
        slider = machine.io.slider
        return _MODE.pack(int(now.t * 1e6), *map(int, flags), now.robot_mode & 0xFF, 0, slider, now.speed_scaling, 1.0, 0)
