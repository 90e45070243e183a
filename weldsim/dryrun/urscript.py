"""The motions of a URScript program in their order: it is run with functions that write down what they are asked for.

Functions, variables, loops and poses that are computed are the program's own affair; one whose motions depend on an input, a
register or a thread cannot be told beforehand and is refused where it begins to.
"""

import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.program import Command, Motion, Program
from weldsim.dryrun.robot_state import RobotState
from weldsim.dryrun.script_names import ASKING, MOVING, OUTPUTS, RESTING, SILENT
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.urscript.check import is_pose, six
from weldsim.urscript.compiler import FILE, Compiled, compile_program
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.geometry import PoseFunctions
from weldsim.urscript.numbers import NumberFunctions
from weldsim.urscript.values import OPERATIONS, number

TURNS = 10_000  # of all loops together; more is a program that does not end
LOOKED_AFTER, REPEATS, LONGEST_ROUND = 1000, 4, 500  # turns; rounds that must be alike, and motions of one at most
FURTHEST, LONGEST_TOOL, LONGEST_TURN = 3.0, 1.0, 2 * np.pi + 1e-6  # [m] of a pose from the base, of a TCP from the flange; [rad]
LARGEST_ANGLE = 8 * np.pi  # [rad] of a joint


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
    recorder = _Recorder(X_FT, q_start)
    try:
        recorder.run(compile_program(text.replace("\r\n", "\n").replace("\r", "\n"), recorder.builtins()))
    except ScriptError as error:
        where = f"line {error.line}: " if error.line else ""
        raise InputError(f"{source}: {where}{error.reason}", path=source, line=error.line) from None
    if not recorder.motions and recorder.halted:
        said = f": {recorder.shown}" if recorder.shown else ""
        raise InputError(f"{source}: halts before it moves{said}", path=source)
    if not recorder.motions:
        raise InputError(f"{source}: makes no movej, movel, movep or servoj; there is nothing to check", path=source)
    if len(recorder.motions) < 2:
        raise InputError(f"{source}: 1 motion; a path needs two", path=source)
    return Program(
        source=source.rpartition("/")[2],
        kind="script",
        motions=tuple(recorder.motions),
        X_FT=recorder.state.mount,
        pauses=recorder.pauses,
        notes=tuple(recorder.notes),
    )


class _HaltError(Exception):
    """The program said halt."""


class _Unknown:
    """What a function would say that asks a robot: nothing can be decided by it."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, name: str) -> None:
        self._name = name

    def _refuse(self, *_: object) -> Any:
        raise ScriptError(f"{self._name}: what follows depends on its answer and cannot be told beforehand")

    __bool__ = __eq__ = __ne__ = __lt__ = __gt__ = __le__ = __ge__ = _refuse


class _Recorder:
    """A program's functions. Attributes: motions, what they wrote down; state, of the robot by then; pauses [s]; notes;
    halted, whether it said so; shown, the last popup."""

    def __init__(self, fixed: Transform | None, q_start: Float[ndarray, "6"] | None) -> None:
        self.fixed, self.state = fixed, RobotState(fixed or X_FT, q_start)
        self.halted, self.shown = False, ""
        self.motions: list[Motion] = []
        self.notes: list[str] = []
        self.pauses = 0.0
        self.lines: tuple[int, ...] = ()
        self.turns, self.on, self.said = 0, set(), set()

    def run(self, compiled: Compiled) -> None:
        """The whole program, once. Raises ScriptError with the line."""
        self.lines = compiled.lines
        names: dict[str, Any] = {f"b_{name}": function for name, function in self.builtins().items()} | OPERATIONS
        refuse = {"_run": "run", "_kill": "kill", "_join": "join"}
        names |= {key: _refusing(f"{word}: what threads do cannot be told beforehand") for key, word in refuse.items()}
        names |= {"_halt": self._halt, "_spin": self._spin, "_enter": lambda: None, "_leave": lambda: None}
        try:
            exec(compiled.code, names)  # built from the syntax tree alone, see the compiler
            for _ in names["main"]():
                pass
        except _HaltError:
            self.halted = True
        except ScriptError as error:
            raise ScriptError(error.reason, error.line or self._line(error)) from None
        except (TypeError, ValueError, ArithmeticError, NameError, LookupError, RecursionError) as error:
            raise ScriptError(" ".join(f"{error}".split())[:120] or type(error).__name__, self._line(error)) from None

    def builtins(self) -> dict[str, Callable]:
        """{name: function} of all that a program can call."""
        groups = (PoseFunctions(), NumberFunctions(), self.state)
        out: dict[str, Callable] = {
            name: getattr(group, name)
            for group in groups
            for name in dir(group)
            if not name.startswith("_") and callable(getattr(group, name))
        }
        out |= {name: self._asking(name) for name in ASKING}
        out |= {name: self._passed_over(name) for name in SILENT}
        out |= {name: _refusing(f"{name}: its motion is not checked; use movej, movel, movep or servoj") for name in MOVING}
        out |= dict.fromkeys(RESTING, lambda *_, **__: None)
        out |= {name: self._output(name) for name in OUTPUTS}
        mine = (self.movej, self.movel, self.movep, self.servoj, self.set_tcp, self.sleep)
        return out | {function.__name__: function for function in mine}

    def movej(self, q: Any, a: float = 1.4, v: float = 1.05, t: float = 0, r: float = 0) -> None:
        self._move("movej", q, a, v, t, r)

    def movel(self, pose: Any, a: float = 1.2, v: float = 0.25, t: float = 0, r: float = 0) -> None:
        self._move("movel", pose, a, v, t, r)

    def movep(self, pose: Any, a: float = 1.2, v: float = 0.25, r: float = 0) -> None:
        self._move("movep", pose, a, v, 0, r)

    def servoj(self, q: Any, a: float = 0, v: float = 0, t: float = 0.008, lookahead_time: float = 0.1, gain: float = 300) -> None:
        if not number(t) > 0:
            raise ScriptError(f"servoj: time {t:g} s must be positive")
        self._record("servoj", q, 0.0, 0.0, t)

    def set_tcp(self, pose: Any, tcp_name: str = "") -> None:
        if not isinstance(pose, list) or len(pose) != 6:
            raise ScriptError("set_tcp: p[x, y, z, rx, ry, rz] is needed")
        x = six(pose, "set_tcp")
        _check_pose(x, "set_tcp: ", "from the flange", LONGEST_TOOL)
        self.said.add("tcp")
        if self.fixed is None:
            self.state.mount = Transform.from_rotation_vector("FT", np.array(x[3:]), np.array(x[:3]))

    def sleep(self, t: float) -> None:
        if not 0 <= number(t) < np.inf:
            raise ScriptError(f"sleep: {t:g} s must not be negative")
        self.pauses += t

    def _move(self, name: Command, target: Any, a: Any, v: Any, t: Any, r: Any) -> None:
        if not (0 < number(v) < np.inf and 0 < number(a) < np.inf):
            raise ScriptError(f"{name}: speed {v:g} and acceleration {a:g} must be positive")
        if not (0 <= number(t) < np.inf and 0 <= number(r) < np.inf):
            raise ScriptError(f"{name}: time {t:g} s and blend radius {r:g} m must not be negative")
        if r > 0:
            self._note("blend", "blends are not modelled: each motion is checked as if it came to rest at its target")
        self._record(name, target, float(v), float(a), t)

    def _record(self, name: Command, target: Any, speed: float, acceleration: float, t: float) -> None:
        if isinstance(target, _Unknown):
            bool(target)
        if not isinstance(target, list) or len(target) != 6:
            raise ScriptError(f"{name}: the target must be p[x, y, z, rx, ry, rz] or [six joint angles]")
        values = six(target, f"{name}: target")
        q, X_BT = None, None
        if is_pose(target):
            _check_pose(values, f"{name}: ", "from the base", FURTHEST)
            if "tcp" not in self.said and self.fixed is None:
                self._note(
                    "no tcp", "the program sets no TCP before its first pose: poses are read as the wire's tip (--tool tool0)"
                )
            X_BT = self.state.to_pose(values) @ X_FT  # the torch hangs on the flange whatever the TCP is
        else:
            q = np.array(values)
            if np.abs(q).max() > LARGEST_ANGLE:
                raise ScriptError(f"{name}: a joint at {np.abs(q).max():.4g} rad: looks like degrees")
            self.state.to_joints(values)
        line = self._line() or 0
        kept = {"speed": speed, "acceleration": acceleration, "t": float(t), "arc": bool(self.on)}
        self.motions.append(Motion(command=name, line=line, q=q, X_BT=X_BT, **kept))  # type: ignore[arg-type]

    def _output(self, name: str) -> Callable:
        def switch(n: int, b: bool) -> None:
            bool(b)
            (self.on.add if b else self.on.discard)((name.replace("_standard", ""), n))

        return switch

    def _asking(self, name: str) -> Callable:
        return lambda *_, **__: _Unknown(name)

    def _passed_over(self, name: str) -> Callable:
        def silent(*said: object, **__: object) -> str:
            if name == "popup" and said:
                self.shown = " ".join(str(said[0]).split())[:200]
            self._note(name, f"line {self._line()}: {name} does not move the arm and is passed over")
            return ""

        return silent

    def _note(self, about: str, text: str) -> None:
        if about not in self.said:
            self.said.add(about)
            self.notes.append(text)

    def _halt(self) -> Iterator[None]:
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
        if len(set(told[-LONGEST_ROUND:])) < 2:
            return
        for period in range(2, min(LONGEST_ROUND, len(told) // REPEATS) + 1):
            if all(told[-k] == told[-k - period] for k in range(1, (REPEATS - 1) * period + 1)):
                last = len(told) - REPEATS * period
                while last > 0 and told[last - 1] == told[last - 1 + period]:
                    last -= 1
                kept = self.motions[: last + 2 * period]
                self.pauses *= len(kept) / len(self.motions)
                self.motions[:] = kept
                self._note(
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
