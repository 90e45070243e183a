"""The controller itself: modes, program, reference and arm, advanced together one control period at a time.

Servers and fault injection call its methods between two ticks; nothing here knows of sockets or of the wall clock.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping

from weldsim.controller.arm import Arm
from weldsim.controller.config import ControllerConfig
from weldsim.controller.kinematics import Kinematics
from weldsim.controller.profile import Profile
from weldsim.controller.reference import Reference
from weldsim.controller.registers import Registers
from weldsim.controller.snapshot import Snapshot
from weldsim.controller.tool import Tool
from weldsim.controller.watchdog import Watchdogs
from weldsim.execution.ur_modes import RobotMode, RuntimeState, SafetyMode
from weldsim.urscript.compiler import Compiled, compile_program
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.poses import matrix_of
from weldsim.urscript.program import Program

LOG_LINES = 500
PACE_RATE = 4.0  # [1/s] of the speed slider's effect; no published figure, but no arm changes its speed in one period
WAITING = "def loaded_program():\n  while True:\n    sync()\n  end\nend\n"  # what a program file does that is played


class Machine:
    """A UR controller without its network.

    Attributes:
        profile, config: what it is.  arm: what it moves.  kinematics: what it knows of its geometry.
        io: registers and signals.  reference: what the arm follows.
        tool: active TCP and payload.  watchdogs: over input registers.
        t: time since power-on [s].  busy: wall-clock time that the last period took [s].
        robot_mode, safety_mode, runtime: states.
        remote: whether clients may act (e-Series).  popup: text that is shown, or "".
        loaded: name of the program file that was loaded on the dashboard, or "".
        log: the last messages, each a time and a text.
        history: joint angles of the last periods, the newest last.
        pace: share of the programmed speed at which moves go on; it follows the speed slider.
        limiter: what a move is slowed down by for its joints' sake, 1 where it need not be.
        waypoint: pose at which the move under way will end, or None without one.
    """

    def __init__(self, profile: Profile, arm: Arm, config: ControllerConfig | None = None) -> None:
        self.profile, self.arm, self.config = profile, arm, config or ControllerConfig()
        self.io, self.tool, self.watchdogs = Registers(), Tool(), Watchdogs()
        self.kinematics = Kinematics(self.config.calibration.dh)
        self.reference = Reference(arm.q, profile.period, self.kinematics)
        self.t, self.busy = 0.0, 0.0
        self.pace, self.limiter = self.io.slider, 1.0
        self.waypoint: list[float] | None = None
        self.robot_mode, self.safety_mode, self.runtime = RobotMode.RUNNING, SafetyMode.NORMAL, RuntimeState.STOPPED
        self.remote, self.popup, self.loaded = True, "", ""
        self.log: deque[tuple[float, str]] = deque(maxlen=LOG_LINES)
        self.on_message: Callable[[str], None] | None = None
        self.history: deque[list[float]] = deque([arm.q], maxlen=100)
        self._builtins: Mapping[str, Callable] = {}
        self._elsewhere: Collection[str] = ()
        self._program: Program | None = None
        self._compiled: dict[str, Compiled] = {}
        self._beside: list[Program] = []
        self._stopped_at = 0.0
        self._snapshot: Snapshot | None = None

    def provide(self, builtins: Mapping[str, Callable], elsewhere: Collection[str] = ()) -> None:
        """The functions that programs can call, and the names of those that an e-Series alone has, where this is none."""
        self._builtins, self._elsewhere = builtins, elsewhere

    @property
    def snapshot(self) -> Snapshot:
        """What the controller reports after the last tick; built when first asked for."""
        if self._snapshot is None:
            self._snapshot = Snapshot(self)
        return self._snapshot

    @property
    def can_move(self) -> bool:
        return self.robot_mode is RobotMode.RUNNING and self.safety_mode is SafetyMode.NORMAL

    @property
    def program_name(self) -> str:
        """Of the program that runs or is paused, or "" without one."""
        return self._program.name if self._program is not None else ""

    def say(self, text: str) -> None:
        """Add a message to the log."""
        self.log.append((self.t, text))
        if self.on_message is not None:
            self.on_message(text)

    def tick(self) -> None:
        """One control period."""
        self._snapshot = None
        self.pace += min(PACE_RATE * self.profile.period, max(-PACE_RATE * self.profile.period, self.io.slider - self.pace))
        self.reference.commanded = False
        if self.runtime is RuntimeState.PLAYING and self.can_move:
            self._run_program()
        for program in self._beside:
            self._step(program)
        self._beside = [program for program in self._beside if program.running]
        if not self.reference.commanded:
            self.reference.rest()
        self.arm.advance(self.reference.q, self.reference.qd)
        self.history.append(self.arm.q)
        self.t += self.profile.period
        touched = self.arm.collisions()
        if touched and self.can_move:
            self.protective_stop(f"collision: {touched[0]}")

    def _run_program(self) -> None:
        for name, action in self.watchdogs.expired(self.t):
            self.say(f"watchdog: {name} was not updated in time: {action}")
            if action == "pause":
                self.pause()
                return
            if action == "stop":
                self.stop_program()
                return
        if self._program is not None:
            self._step(self._program)
            if not self._program.running:
                self._end_program()

    def _step(self, program: Program) -> None:
        try:
            program.step()
        except ScriptError as error:
            self.say(f"program {program.name} failed: {error}")

    def _end_program(self) -> None:
        self._program, self.runtime = None, RuntimeState.STOPPED
        self.watchdogs.clear()
        for bit in self.config.low_when_stopped:
            self.io.set_digital_out(bit, False)

    def upload(self, text: str) -> bool:
        """Compile a script and run it in place of the one that runs; False, with a message in the log, where it cannot be."""
        if self.profile.remote_control and not self.remote:
            self.say("script refused: the robot is in local control")
            return False
        try:
            compiled = self._compiled.get(text) or compile_program(text, self._builtins)
            self._compiled = {text: compiled}  # a client uploads its script again and again
            program = Program(compiled, self._builtins)
        except ScriptError as error:
            other = any(f"no function {name!r}" in str(error) for name in self._elsewhere)
            hint = "; an e-Series has it: start the controller with --profile e" if other else ""
            self.say(f"script refused: {error}{hint}")
            return False
        if compiled.kind == "sec":
            self._beside.append(program)
            return True
        if not self.can_move:
            self.say(f"script refused: robot mode {self.robot_mode.name}, safety mode {self.safety_mode.name}")
            return False
        self.stop_program()
        self._program, self.runtime = program, RuntimeState.PLAYING
        return True

    def stop_program(self) -> None:
        """End the program; the arm comes to rest. Harmless without one."""
        if self._program is not None:
            self._program.stop()
            self._end_program()

    def pause(self) -> bool:
        """Hold the program; whether there was one to hold."""
        if self.runtime is RuntimeState.PLAYING:
            self.runtime = RuntimeState.PAUSED
            for bit in self.config.low_when_stopped:
                self.io.set_digital_out(bit, False)
            return True
        return False

    def play(self) -> bool:
        """Let a held program go on, or else start the loaded one; whether there was one and the arm may move.

        Program files are not modelled: one that is loaded waits until it is stopped.
        """
        if not self.can_move:
            return False
        if self.runtime is RuntimeState.PAUSED:
            self.runtime = RuntimeState.PLAYING
            return True
        if self.runtime is RuntimeState.STOPPED and self.loaded and self.upload(WAITING) and self._program is not None:
            self._program.name = self.loaded
            return True
        return False

    def protective_stop(self, reason: str) -> None:
        """Stop the arm and hold the program until someone unlocks it."""
        if self.safety_mode is SafetyMode.NORMAL:
            self.safety_mode, self._stopped_at = SafetyMode.PROTECTIVE_STOP, self.t
            self.say(f"protective stop: {reason}")
            self.pause()

    def unlock(self) -> bool:
        """Lift a protective stop; False within `unlock_delay` of it."""
        if self.safety_mode is SafetyMode.PROTECTIVE_STOP:
            if self.t - self._stopped_at < self.config.unlock_delay:
                return False
            self.safety_mode = SafetyMode.NORMAL
        return True

    def take_local(self) -> None:
        """Somebody at the pendant takes over: the program ends, clients may only look. A CB3 knows no such mode: nothing."""
        if self.profile.remote_control:
            self.remote = False
            self.say("local control")
            self.stop_program()

    def lift(self) -> None:
        """Lift a protective stop at once."""
        if self.safety_mode is SafetyMode.PROTECTIVE_STOP:
            self.safety_mode = SafetyMode.NORMAL

    def emergency_stop(self) -> None:
        """The red button: the program ends, the arm stops and loses its power."""
        self.safety_mode, self.robot_mode = SafetyMode.ROBOT_EMERGENCY_STOP, RobotMode.POWER_OFF
        self.say("emergency stop")
        self.stop_program()

    def release(self) -> None:
        """Pull the red button out; power and brakes stay as they are."""
        if self.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP:
            self.safety_mode = SafetyMode.NORMAL

    def power(self, mode: RobotMode) -> bool:
        """Switch to POWER_OFF, IDLE (powered, brakes on) or RUNNING; False in an emergency stop."""
        if self.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP and mode is not RobotMode.POWER_OFF:
            return False
        if mode is RobotMode.IDLE and self.robot_mode is RobotMode.RUNNING:
            return True
        if mode is not RobotMode.RUNNING:
            self.stop_program()
        self.robot_mode = mode
        return True

    def set_tcp(self, pose: list[float]) -> None:
        """The active tool centre point, X_FT as a pose."""
        self.tool.tcp, self.tool.tcp_matrix = pose, matrix_of(pose)

    def written(self, names: Iterable[str]) -> None:
        """An RTDE client has written these inputs."""
        self.watchdogs.fed(names, self.t)
