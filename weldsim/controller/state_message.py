"""What the primary and secondary interfaces, ports 30001 and 30002, tell of a controller: its version once, then its state.

Layout: the manufacturer's 'Primary and Secondary Interfaces', software 3.15 and 5.11. Of the sub-packages of a state those that
say what is modelled; the ones for the manufacturer's own use (9, 10) and the tool's serial line (11, 12) are left out, which a
client finds by the sizes. Checked with the parser of urx 0.11 for CB3, whose mode has 46 bytes; that of an e-Series has 47.
"""

import struct
from collections.abc import Iterator

from weldsim.controller.machine import Machine
from weldsim.execution.primary_packet import KINEMATICS_INFO, MODE_DATA, ROBOT_MESSAGE, ROBOT_STATE, KinematicsInfo, framed
from weldsim.execution.ur_modes import RuntimeState, SafetyMode
from weldsim.kinematics import JOINT_LIMIT, SPEED_LIMIT

JOINTS, TOOL, MASTERBOARD, CARTESIAN, CONFIGURATION, FORCE, ADDITIONAL = 1, 2, 3, 4, 6, 7, 8  # types of sub-packages
VERSION_MESSAGE = 3
PROJECT = b"URControl"
DEFAULTS = (1.05, 1.4, 0.25, 1.2, 0.25)  # v [rad/s], a [rad/s2] of joints; v [m/s], a [m/s2] of the tool; radius [m] of a turn
MAX_ACCELERATION = 40.0  # [rad/s2]
UR5 = 1  # robot type
WARM = 30.0  # [degree Celsius] of whatever has a temperature
_EMERGENCY = (SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SYSTEM_EMERGENCY_STOP)
_MODE = struct.Struct(">Q7BBBddd")
_JOINT = struct.Struct(">dddffffB")
_TOOL = struct.Struct(">BBddfBffB")
_MASTERBOARD = struct.Struct(">iiBBddBBddffffBBBIBB")
_CARTESIAN = struct.Struct(">12d")
_CONFIGURATION = struct.Struct(">24d5d24d4i")
_FORCE = struct.Struct(">7d")


def version_message(machine: Machine) -> bytes:
    """The message that is sent once: project, version, build date."""
    major, minor, bugfix, build = machine.profile.version
    date = machine.profile.software.partition("(")[2].rstrip(")").encode()
    head = struct.pack(">QbBB", 0, -2, VERSION_MESSAGE, len(PROJECT))
    return framed(ROBOT_MESSAGE, head + PROJECT + struct.pack(">BBii", major, minor, bugfix, build) + date)


def state_message(machine: Machine) -> bytes:
    """The state after the last control period."""
    return framed(ROBOT_STATE, b"".join(framed(kind, contents) for kind, contents in _sub_packages(machine)))


def _sub_packages(machine: Machine) -> Iterator[tuple[int, bytes]]:
    now = machine.snapshot
    e_series = machine.profile.series == "e"
    yield MODE_DATA, _mode(machine) + (b"\0" if e_series else b"")
    yield (
        JOINTS,
        b"".join(
            _JOINT.pack(q, q_target, qd, current, now.voltage, WARM, 0.0, now.joint_mode)
            for q, q_target, qd, current in zip(now.q, now.q_target, now.qd, now.current, strict=True)
        ),
    )
    yield TOOL, _TOOL.pack(1, 1, 0.0, 0.0, now.voltage, machine.io.tool_voltage, 0.0, WARM, now.joint_mode)
    yield MASTERBOARD, _masterboard(machine)
    yield CARTESIAN, _CARTESIAN.pack(*now.tcp_pose, *now.tcp_offset)
    yield KINEMATICS_INFO, KinematicsInfo(machine.kinematics.dh, machine.config.calibration.calibration_status).encode()
    yield CONFIGURATION, _configuration(machine)
    yield FORCE, _FORCE.pack(*[0.0] * 7)
    yield ADDITIONAL, bytes([0, 1, 0, 0] if e_series else [0, 1, 0])


def _mode(machine: Machine) -> bytes:
    """Time [us]; flags: connected, enabled, powered, emergency stop, protective stop, program running, paused; modes; speeds."""
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
    return _MODE.pack(int(now.t * 1e6), *map(int, flags), now.robot_mode & 0xFF, 0, machine.io.slider, now.speed_scaling, 1.0)


def _masterboard(machine: Machine) -> bytes:
    """Signals, voltages, safety mode; no Euromap 67 interface."""
    io, now = machine.io, machine.snapshot
    return _MASTERBOARD.pack(
        io.digital_in,
        io.digital_out,
        io.analog_in_domain & 1,
        io.analog_in_domain >> 1 & 1,
        *io.analog_in,
        io.analog_out_domain & 1,
        io.analog_out_domain >> 1 & 1,
        *io.analog_out,
        WARM,
        now.voltage,
        now.robot_current,
        0.0,
        now.safety_mode,
        *(0, 0, 0),
        *(0, 0),
    )


def _configuration(machine: Machine) -> bytes:
    """Joint ranges, speeds and accelerations, defaults of moves, DH figures: a, d, alpha, theta."""
    theta, a, d, alpha = machine.kinematics.dh.T
    limits = [-JOINT_LIMIT, JOINT_LIMIT] * 6 + [SPEED_LIMIT, MAX_ACCELERATION] * 6
    return _CONFIGURATION.pack(*limits, *DEFAULTS, *a, *d, *alpha, *theta, 0, 0, UR5, 0)
