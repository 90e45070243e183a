"""The motions of a URScript program in their order: it is run with functions that write down what they are asked for.

Functions, variables, loops and poses that are computed are the program's own affair. What a robot would be asked for is
unknown: waits, choices and threads that depend on it and move nothing are passed over and told; a program whose motions depend on
it cannot be told beforehand and is refused where they begin to.
"""

import re
import sys
from collections.abc import Callable, Iterator
from functools import wraps
from itertools import islice
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.program import Command, Motion, Program
from weldsim.dryrun.robot_state import INSIDE, RobotState
from weldsim.dryrun.script_names import ASKING, MOVES, MOVING, OUTPUTS, RESTING, SILENT
from weldsim.dryrun.script_notes import ScriptNotes
from weldsim.dryrun.unknown import UNKNOWN_OPERATIONS, NoSolution, Unknown, UntoldError, spreading, unknown_among
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.motion.sweep import STEP_LENGTH
from weldsim.mounts import X_FT
from weldsim.urscript.arc import Arc
from weldsim.urscript.check import is_pose, six
from weldsim.urscript.compiler import FILE, Compiled, compile_program
from weldsim.urscript.effects import Effects
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.geometry import PoseFunctions
from weldsim.urscript.numbers import NumberFunctions
from weldsim.urscript.strings import StringFunctions
from weldsim.urscript.values import Pose, number

TURNS = 10_000  # of all loops together; more is a program that does not end
LOOKED_AFTER, REPEATS, LONGEST_ROUND = 1000, 4, 500  # turns; rounds that must be alike, and motions of one at most
FURTHEST, LONGEST_TOOL, LONGEST_TURN = 3.0, 1.0, 2 * np.pi + 1e-6  # [m] of a pose from the base, of a TCP from the flange; [rad]
LARGEST_ANGLE = 8 * np.pi  # [rad] of a joint
DECIMAL = r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*"
JOINT_LIST = re.compile(rf"(?<!p)\[({DECIMAL}(?:,{DECIMAL}){{5}})\]")  # six numbers that are no pose
STARTS = 20  # of them that are tried


def parse_script(text: str, *, source: str, X_FT: Transform | None = None, q_start: Float[ndarray, "6"] | None = None) -> Program:
    """The motions of a program, poses turned into torch poses.

    Args:
        text: the program.  source: its name, for errors.
        X_FT: flange to the frame that poses are of, in place of what the program sets.
        q_start: where the arm stands when it begins [rad], for programs that ask; None where that is not known.
    Raises:
        InputError: a line that cannot be read, a function nobody knows, a target that is not finite or in millimetres, motions
            that cannot be told beforehand, no motion.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    recorder = _recorded(text, source, X_FT, q_start)
    if len(recorder.motions) < 2 and recorder.halted_at is not None:
        advice = _how_to_start(text, source, X_FT, recorder)
        raise InputError(f"{source}: {recorder.halted}{advice}", path=source, line=recorder.halted_at)
    if not recorder.motions and recorder.effects is not None and (movers := recorder.effects.movers()):
        raise InputError(
            f"{source}: never calls what it defines ({', '.join(movers)[:80]}), so nothing moves; end it with the call that is"
            f" meant, {movers[-1]}() say",
            path=source,
        )
    if not recorder.motions:
        raise InputError(f"{source}: makes no movej, movel, movep, movec or servoj; there is nothing to check", path=source)
    if len(recorder.motions) < 2:
        raise InputError(f"{source}: 1 motion; a path needs two", path=source)
    if recorder.effects is not None:
        for name, line in recorder.effects.moving_threads():  # one that runs is refused
            recorder.notes.add(
                f"thread {name}", f"line {line}: thread {name} would move the arm, but is never run: its motions are not checked"
            )
    if recorder.halted_at is not None:
        recorder.notes.add("halt", f"{recorder.halted}; what comes after it is not read")
    return Program(
        source=source.rpartition("/")[2],
        kind="script",
        motions=tuple(recorder.motions),
        X_FT=recorder.state.mount,
        pauses=recorder.pauses,
        notes=recorder.notes.sentences(),
        from_start=_from_start(recorder),
    )


def _recorded(text: str, source: str, X_FT: Transform | None, q_start: Float[ndarray, "6"] | None) -> "_Recorder":
    """What a program was asked for. Raises InputError."""
    recorder = _Recorder(X_FT, q_start)
    try:
        recorder.run(compile_program(text, recorder.builtins(), moving=MOVES))
    except ScriptError as error:
        where = f"line {error.line}: " if error.line else ""
        raise InputError(f"{source}: {where}{error.reason}", path=source, line=error.line) from None
    return recorder


def _how_to_start(text: str, source: str, X_FT: Transform | None, halted: "_Recorder") -> str:
    """What makes a program go on that halts by how the arm stands: joint angles that it holds itself and with which it moves."""
    if not halted.state.asked:
        return "; take the halt out to have what follows checked"
    for found in islice(dict.fromkeys(JOINT_LIST.findall(text)), STARTS):
        said = ", ".join(f"{float(value):.4f}" for value in found.split(","))
        try:
            moves = _recorded(text, source, X_FT, np.array([float(value) for value in said.split(",")])).motions
        except InputError:
            continue
        if len(moves) > 1:
            return f'; with --start "{said}" it goes on'
    return f"; it asks where the arm stands ({halted.state.asked}): say that with --start"


def _from_start(recorder: "_Recorder") -> str:
    """What of a program depends on how the arm stands when it begins, or ""."""
    first = recorder.motions[0]
    if recorder.state.asked:
        return f"the program asks where the arm stands before its first motion ({recorder.state.asked})"
    if first.command == "movej" and first.q is not None:
        return ""
    return f"line {first.line}: the first motion is a {first.command}{'' if first.q is not None else ' to a pose'}"


class _HaltError(Exception):
    """The program said halt."""


class _Recorder:
    """A program's functions. Attributes: motions, what they wrote down; state, of the robot by then; pauses [s]; notes;
    halted_at, the line where it said so, or None; shown, the last popup."""

    def __init__(self, fixed: Transform | None, q_start: Float[ndarray, "6"] | None) -> None:
        self.fixed, self.state = fixed, RobotState(X_FT if fixed is None else fixed, q_start)
        self.halted_at: int | None = None
        self.shown = ""
        self.motions: list[Motion] = []
        self.notes = ScriptNotes()
        self.pauses = 0.0
        self.lines: tuple[int, ...] = ()
        self.turns, self.on, self.tcp_set = 0, set(), False
        self.changing: dict[str, str] = {}  # {variable: the thread that changes it}
        self.names: dict[str, Any] = {}
        self.effects: Effects | None = None

    def run(self, compiled: Compiled) -> None:
        """The whole program, once. Raises ScriptError with the line."""
        self.lines, self.effects = compiled.lines, compiled.effects
        self.names = names = {f"b_{name}": function for name, function in self.builtins().items()} | dict(UNKNOWN_OPERATIONS)
        names |= {"_run": self._run, "_kill": lambda handle: None, "_join": lambda handle: iter(())}
        names |= {"_halt": self._halt, "_spin": self._spin, "_enter": lambda: None, "_leave": lambda: None}
        names |= {"_pass_over": self._pass_over, "_of_thread": self._of_thread}
        try:
            exec(compiled.code, names)  # built from the syntax tree alone, see the compiler
            for _ in names["main"]():
                pass
        except _HaltError:
            pass
        except ScriptError as error:
            raise ScriptError(error.reason, error.line or self._line(error)) from None
        except (TypeError, ValueError, ArithmeticError, NameError, LookupError, RecursionError) as error:
            raise ScriptError(" ".join(f"{error}".split())[:120] or type(error).__name__, self._line(error)) from None

    def builtins(self) -> dict[str, Callable]:
        """{name: function} of all that a program can call."""
        groups = (PoseFunctions(), NumberFunctions(), StringFunctions(), self.state)
        out: dict[str, Callable] = {
            name: spreading(getattr(group, name))
            for group in groups
            for name in dir(group)
            if not name.startswith("_") and name not in INSIDE and callable(getattr(group, name))
        }
        solve = out["get_inverse_kin"]

        @wraps(solve)
        def get_inverse_kin(*arguments: Any, **named: Any) -> Any:
            self._tell_of_tcp()
            return solve(*arguments, **named)

        out["get_inverse_kin"] = get_inverse_kin
        out |= {name: self._asking(name) for name in ASKING}
        out |= {name: self._passed_over(name) for name in SILENT}
        out |= {name: _refusing(f"{name}: its motion is not checked; use movej, movel, movep, movec or servoj") for name in MOVING}
        out |= dict.fromkeys(RESTING, lambda *_, **__: None)
        out |= {name: self._output(name) for name in OUTPUTS}
        mine = (self.movej, self.movel, self.movep, self.movec, self.servoj, self.set_tcp)
        return out | {function.__name__: function for function in mine} | {"sleep": self.sleep}

    def movej(self, q: Any, a: Any = 1.4, v: Any = 1.05, t: Any = 0, r: Any = 0) -> None:
        self._move("movej", q, a, v, t, r)

    def movel(self, pose: Any, a: Any = 1.2, v: Any = 0.25, t: Any = 0, r: Any = 0) -> None:
        self._move("movel", pose, a, v, t, r)

    def movep(self, pose: Any, a: Any = 1.2, v: Any = 0.25, r: Any = 0) -> None:
        self._move("movep", pose, a, v, 0, r)

    def movec(self, pose_via: Any, pose_to: Any, a: Any = 1.2, v: Any = 0.25, r: Any = 0, mode: Any = 0) -> None:
        bool(unknown_among(pose_via, pose_to, mode))
        if not all(is_pose(pose) and len(pose) == 6 for pose in (pose_via, pose_to)):
            raise ScriptError("movec: its poses must be p[x, y, z, rx, ry, rz]")
        via, end = (six(pose, f"movec: {name}") for pose, name in ((pose_via, "pose_via"), (pose_to, "pose_to")))
        for pose in (via, end):
            _check_pose(pose, "movec: ", "from the base", FURTHEST)
        if number(mode) not in (0, 1):
            raise ScriptError(f"movec: mode = {mode} is neither 0 nor 1")
        circle = Arc(self.state.tcp_pose("movec"), via, end, fixed=bool(mode))
        steps = max(2, int(np.ceil(circle.length / STEP_LENGTH)))
        poses = np.array([circle.at(share) for share in np.linspace(0.0, 1.0, steps + 1)[1:]])
        X_BE = Transform.from_rotation_vector("BT", poses[:, 3:], poses[:, :3])
        way = X_BE @ self.state.mount.inverse() @ X_FT
        self._move("movec", Pose(poses[-1].tolist()), a, v, 0, r, way)

    def servoj(self, q: Any, a: Any = 0, v: Any = 0, t: Any = 0.008, lookahead_time: Any = 0.1, gain: Any = 300) -> None:
        bool(unknown_among(t))
        if not number(t) > 0:
            raise ScriptError(f"servoj: time {t:g} s must be positive")
        self._record("servoj", q, 0.0, 0.0, t)

    def set_tcp(self, pose: Any, tcp_name: str = "") -> None:
        bool(unknown_among(pose))
        if not isinstance(pose, list) or len(pose) != 6:
            raise ScriptError("set_tcp: p[x, y, z, rx, ry, rz] is needed")
        x = six(pose, "set_tcp")
        _check_pose(x, "set_tcp: ", "from the flange", LONGEST_TOOL)
        self.tcp_set = True
        if self.fixed is None:
            self.state.mount = Transform.from_rotation_vector("FT", np.array(x[3:]), np.array(x[:3]))

    def sleep(self, t: Any) -> None:
        if isinstance(t, Unknown):
            self.notes.passed_over(t.what, self._line() or 0, wait=True)
            return
        if not 0 <= number(t) < np.inf:
            raise ScriptError(f"sleep: {t:g} s must not be negative")
        self.pauses += t

    def _move(self, name: Command, target: Any, a: Any, v: Any, t: Any, r: Any, way: Transform | None = None) -> None:
        bool(unknown_among(a, v, t, r))
        if not (0 < number(v) < np.inf and 0 < number(a) < np.inf):
            raise ScriptError(f"{name}: speed {v:g} and acceleration {a:g} must be positive")
        if not (0 <= number(t) < np.inf and 0 <= number(r) < np.inf):
            raise ScriptError(f"{name}: time {t:g} s and blend radius {r:g} m must not be negative")
        if r > 0:
            self.notes.add("blend", "blends are not modelled: each motion is checked as if it came to rest at its target")
        self._record(name, target, float(v), float(a), t, way)

    def _record(
        self, name: Command, target: Any, speed: float, acceleration: float, t: float, way: Transform | None = None
    ) -> None:
        q, X_BT = self._joints_and_pose(name, target)
        kept = {"speed": speed, "acceleration": acceleration, "t": float(t), "arc": bool(self.on), "way": way}
        self.motions.append(Motion(command=name, line=self._line() or 0, q=q, X_BT=X_BT, **kept))  # type: ignore[arg-type]

    def _joints_and_pose(self, name: Command, target: Any) -> tuple[Float[ndarray, "6"] | None, Transform | None]:
        """The target of a motion as joint angles [rad], or as a pose of the torch, which hangs on the flange whatever the TCP."""
        if isinstance(target, NoSolution):
            return None, self.state.to_flange(target.X_BF) @ X_FT
        bool(unknown_among(target))
        if not isinstance(target, list) or len(target) != 6:
            raise ScriptError(f"{name}: the target must be p[x, y, z, rx, ry, rz] or [six joint angles]")
        values = six(target, f"{name}: target")
        if is_pose(target):
            _check_pose(values, f"{name}: ", "from the base", FURTHEST)
            self._tell_of_tcp()
            return None, self.state.to_pose(values) @ X_FT
        q = np.array(values)
        if np.abs(q).max() > LARGEST_ANGLE:
            raise ScriptError(f"{name}: a joint at {np.abs(q).max():.4g} rad: looks like degrees; write d2r(...) around each")
        self.state.to_joints(values)
        return q, None

    def _tell_of_tcp(self) -> None:
        if not self.tcp_set and self.fixed is None:
            self.notes.add(
                "no tcp",
                "the program sets no TCP before its first pose: poses are read as the wire's tip"
                " (--tool tool0 reads them as the bare flange)",
            )

    def _output(self, name: str) -> Callable:
        def switch(n: Any, b: Any) -> None:
            if (asked := unknown_among(n, b)) is not None:
                self.notes.passed_over(asked.what, self._line() or 0, wait=False)
                return
            (self.on.add if b else self.on.discard)((name.replace("_standard", ""), n))

        return switch

    def _asking(self, name: str) -> Callable:
        return lambda *_, **__: Unknown(name)

    def _passed_over(self, name: str) -> Callable:
        def silent(*said: object, **__: object) -> Unknown:
            if name == "popup" and said and isinstance(said[0], str):
                self.shown = " ".join(said[0].split())[:200]
            self.notes.silent(name, self._line())
            return Unknown(name)

        return silent

    def _run(self, function: Callable, *_: object) -> Unknown:
        """Nothing, where a thread does not move the arm; what it changes is unknown from now on. Raises ScriptError."""
        name = function.__name__.removeprefix("f_")
        call = None if self.effects is None else self.effects.function_moves(name)
        if call is not None:
            raise ScriptError(
                f"run: thread {name} calls {call.function} (line {call.line}): what a thread moves cannot be told beforehand"
            )
        shared = frozenset() if self.effects is None else self.effects.shared_by(name)
        for variable in shared:
            self.changing.setdefault(variable, name)
            self.names.setdefault(f"g_{variable}", Unknown(variable))
        self.notes.add(f"thread {name}", f"line {self._line()}: thread {name} does not move the arm and is passed over")
        return Unknown(f"thread {name}")

    def _of_thread(self, variable: str, value: Any) -> Any:
        thread = self.changing.get(variable)
        return value if thread is None else Unknown(f"{variable}, which thread {thread} changes")

    def _pass_over(self, untold: UntoldError, kind: str) -> Unknown:
        """What a statement assigns that moves nothing and depends on something unknown."""
        self.notes.passed_over(untold.what, self._line() or 0, wait=kind == "While")
        return Unknown(untold.what)

    @property
    def halted(self) -> str:
        """In words where the program halts, and after what."""
        done = f"after {len(self.motions)} motion{'s' if len(self.motions) > 1 else ''}" if self.motions else "before it moves"
        return f"line {self.halted_at}: halts {done}" + (f": {self.shown.rstrip('.')}" if self.shown else "")

    def _halt(self) -> Iterator[None]:
        self.halted_at = self._line() or 0
        raise _HaltError
        yield

    def _spin(self) -> None:
        self.turns += 1
        if self.turns % LOOKED_AFTER == 0:
            self._stop_repeating()
        if self.turns > TURNS:
            raise ScriptError(f"while: over {TURNS} turns; a program that does not end by itself cannot be told beforehand")

    def _stop_repeating(self) -> None:
        """Ends a program that does the same for ever, such as PolyScope's own main loop, after its second round; one that
        only ever goes to one place is left to run out."""
        told = [_told(motion) for motion in self.motions]
        if len(set(told)) < 2:
            return
        for period in range(1, min(LONGEST_ROUND, len(told) // REPEATS) + 1):
            if all(told[-k] == told[-k - period] for k in range(1, (REPEATS - 1) * period + 1)):
                last = len(told) - REPEATS * period
                while last > 0 and told[last - 1] == told[last - 1 + period]:
                    last -= 1
                kept = self.motions[: last + 2 * period]
                self.pauses *= len(kept) / len(self.motions)
                self.motions[:] = kept
                self.notes.add(
                    "rounds",
                    f"line {kept[-1].line}: the program repeats itself over and over; two rounds are checked, and nothing after",
                )
                raise _HaltError

    def _line(self, error: Exception | None = None) -> int | None:
        """The line of the program that runs, or in which an error arose."""
        found = None
        if error is None:
            frame = sys._getframe()
            while frame is not None and frame.f_code.co_filename != FILE:
                frame = frame.f_back
            return None if frame is None else self.lines[frame.f_lineno]
        trace = error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == FILE and trace.tb_lineno < len(self.lines):
                found = self.lines[trace.tb_lineno]
            trace = trace.tb_next
        return found


def _told(motion: Motion) -> tuple[object, ...]:
    """All that makes one motion different from another."""
    targets = (None if motion.q is None else motion.q.tobytes(), None if motion.X_BT is None else motion.X_BT.matrix.tobytes())
    return (motion.command, motion.line, motion.arc, motion.t, motion.speed, motion.acceleration, *targets)


def _refusing(reason: str) -> Callable:
    def refuse(*_: object, **__: object) -> None:
        raise ScriptError(reason)

    return refuse


def _check_pose(values: list[float], what: str, whence: str, limit: float) -> None:
    """Nothing, when a pose is in metres and radians. Raises ScriptError."""
    p, turn = (float(np.linalg.norm(part)) for part in (values[:3], values[3:]))
    if p > limit:
        raise ScriptError(f"{what}{p:.4g} m {whence} (limit {limit:g} m): looks like millimetres")
    if turn > LONGEST_TURN:
        raise ScriptError(f"{what}rotation vector of length {turn:.4g} (limit 2 pi): looks like degrees")
