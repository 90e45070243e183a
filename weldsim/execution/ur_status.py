"""What a UR controller's reported modes mean: whether a stream may go on, and which words say why not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from weldsim.errors import ExecutionError
from weldsim.execution.ur_arm import ArmTold
from weldsim.execution.ur_dashboard import Identity
from weldsim.execution.ur_modes import RobotMode, RuntimeState, SafetyMode
from weldsim.execution.ur_stream import Sample
from weldsim.frames import Transform
from weldsim.records import RobotFacts, RobotState

PROTECTIVE_BIT, EMERGENCY_BITS = 1 << 2, 1 << 5 | 1 << 6 | 1 << 7
MAY_MOVE = (SafetyMode.NORMAL, SafetyMode.REDUCED)
PROGRAM = "rtde_control"  # name of ur_rtde's program on the controller
AT_REST = 0.01  # [rad/s] no joint faster: the arm rests


@dataclass(frozen=True)
class Trouble:
    """Why the arm may not be commanded.

    Attributes:
        rule: short name.  text: what happened and what to do, one line.
        value, limit: what was found and what is needed, numbers or words.
    """

    rule: str
    text: str
    value: object = None
    limit: object = None

    def error(self, name: str, t: float | None = None) -> ExecutionError:
        """The same as an error. Args: name of the robot; t [s] of its clock, None before it is connected."""
        when = "" if t is None else f" (t = {t:.3f} s)"
        return ExecutionError(
            f"{name}: {self.text}{when}", rule=self.rule, value=self.value, limit=self.limit, t=t or 0.0, robot=name
        )


def safety_word(sample: Sample) -> str:
    """The safety system's state, "normal" where nothing is wrong."""
    return _name(SafetyMode, sample.safety_mode)


def mode_word(sample: Sample) -> str:
    """One word for all: a safety stop before the arm's mode before the program's state; "running" where all is well."""
    if sample.safety_mode not in MAY_MOVE:
        return safety_word(sample)
    if sample.robot_mode != RobotMode.RUNNING:
        return _name(RobotMode, sample.robot_mode)
    if sample.runtime_state != RuntimeState.PLAYING:
        return _name(RuntimeState, sample.runtime_state)
    return "running"


def safety_trouble(sample: Sample) -> Trouble | None:
    """What keeps the arm from moving whatever program there is, or None."""
    mode, bits = sample.safety_mode, sample.safety_status_bits
    if bits & EMERGENCY_BITS or mode in (SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SYSTEM_EMERGENCY_STOP):
        return _safety("emergency_stop", "emergency stop; release the button, power on, release the brakes, connect again", mode)
    if bits & PROTECTIVE_BIT or mode == SafetyMode.PROTECTIVE_STOP:
        return _safety("protective_stop", "protective stop; clear its cause, unlock it on the pendant, connect again", mode)
    if mode not in MAY_MOVE:
        word = _name(SafetyMode, mode).replace("_", " ")
        return _safety("safety", f"safety system: {word}; clear it on the pendant, connect again", mode)
    if sample.robot_mode != RobotMode.RUNNING:
        word = _name(RobotMode, sample.robot_mode).replace("_", " ")
        return Trouble(
            "robot_mode",
            f"the arm's mode is {word}, it must be running; power on and release the brakes on the pendant, connect again",
            word,
            "running",
        )
    return None


LOCAL = Trouble("remote_control", "remote control is off; switch the pendant to remote control, connect again", False, True)


def foreign_trouble(program_state: str) -> Trouble | None:
    """The trouble that a program runs which is not ours, or None. Args: program_state, the dashboard's answer of that name."""
    state, _, program = program_state.partition(" ")
    if state != "PLAYING" or program == PROGRAM:
        return None
    text = f"another program runs on the controller ({program}); end it or let it end, connect again"
    return Trouble("foreign_program", text, program, PROGRAM)


def program_trouble(sample: Sample, remote_control: bool | None) -> Trouble | None:
    """What has become of the program that takes our commands, or None while it runs. Args: remote_control, None if unknown."""
    if sample.runtime_state == RuntimeState.PLAYING:
        return None
    word = _name(RuntimeState, sample.runtime_state)
    if remote_control is False:
        return LOCAL
    return Trouble(
        "program",
        f"the control program is {word}, by somebody else or by its watchdog; connect again to start it",
        word,
        "playing",
    )


def follow_distance(target: Sequence[float], commands: Sequence[Sequence[float]]) -> float:
    """Distance [rad] of the controller's own target from the nearest of the last commands, worst joint."""
    return float(np.abs(np.asarray(commands) - np.asarray(target)).max(axis=1).min())


def at_rest(sample: Sample) -> bool:
    return max(map(abs, sample.actual_qd)) < AT_REST


def robot_state(sample: Sample, origin: float, mode: str) -> RobotState:
    """A sample as a record; origin is the controller's time [s] that counts as 0."""
    pose = np.array(sample.actual_TCP_pose)
    return RobotState(
        t=sample.timestamp - origin,
        q=np.array(sample.actual_q),
        qd=np.array(sample.actual_qd),
        X_BT=Transform.from_rotation_vector("BT", pose[3:], pose[:3]),
        mode=mode,
    )


def robot_facts(sample: Sample, identity: Identity, series: str, arm: ArmTold, *, ours: bool, tcp: Sequence[float]) -> RobotFacts:
    """What the controller says of itself.

    Args:
        sample: its newest state.  identity: its dashboard's words.  series: "cb3" or "e".
        arm: its figures, or why they are not told.
        ours: whether the program that runs is ours.  tcp: X_FT as a pose, as read back at connection, for older controllers.
    """
    pose = np.array(sample.tcp_offset or tcp, float)
    return RobotFacts(
        model=identity.model,
        series=series,
        version=identity.software,
        serial=identity.serial,
        dh=arm.dh,
        dh_note=arm.note,
        X_FT=Transform.from_rotation_vector("FT", pose[3:], pose[:3]),
        payload_kg=sample.payload,
        payload_cog=None if sample.payload_cog is None else np.array(sample.payload_cog),
        remote_control=identity.remote_control,
        safety=safety_word(sample),
        mode=mode_word(sample),
        program_running=sample.runtime_state == RuntimeState.PLAYING and not ours,
    )


def _safety(rule: str, text: str, mode: int) -> Trouble:
    return Trouble(rule, text, _name(SafetyMode, mode), "normal")


def _name(kind: type[RobotMode] | type[SafetyMode] | type[RuntimeState], number: int) -> str:
    try:
        return kind(number).name.lower()
    except ValueError:
        return f"unknown ({number})"
