"""How a controller numbers its states (UR RTDE guide), and what the dashboard calls them."""

from enum import IntEnum


class RobotMode(IntEnum):
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7


class SafetyMode(IntEnum):
    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9


class RuntimeState(IntEnum):
    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


def safety_bits(mode: SafetyMode) -> int:
    """`safety_status_bits`: 0 normal, 2 protective stop, 6 robot emergency stop, 7 any emergency stop, 10 stopped due to safety."""
    if mode is SafetyMode.PROTECTIVE_STOP:
        return 1 << 2 | 1 << 10
    if mode is SafetyMode.ROBOT_EMERGENCY_STOP:
        return 1 << 6 | 1 << 7 | 1 << 10
    return 1 << 0
