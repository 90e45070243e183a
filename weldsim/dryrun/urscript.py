"""The motions of a URScript program: movej, movel, movep, servoj with literal or named targets, set_tcp, sleep, outputs.

A program whose motions depend on loops, conditions or sensors cannot be told line by line and is refused where it begins to.
"""

import ast
import re
from collections.abc import Callable

import numpy as np

from weldsim.dryrun.program import Motion, Program
from weldsim.errors import InputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT

Value = float | tuple[str, tuple[float, ...]] | str
DEFAULTS = {"movej": (1.05, 1.4), "movel": (0.25, 1.2), "movep": (0.25, 1.2), "servoj": (0.0, 0.0)}  # speed, acceleration
MOVING = (
    "movec",
    "speedj",
    "speedl",
    "servoc",
    "servol",
    "stopj",
    "stopl",
    "force_mode",
    "teach_mode",
    "freedrive_mode",
    "conveyor",
)
BLOCKS = ("while", "for", "if", "elif", "else", "thread", "switch", "loop")
SILENT = ("def", "end", "sec", "stopj", "stopl")  # what moves is at rest already
FURTHEST, LONGEST_TOOL = 3.0, 1.0  # [m] of a pose from the base, of a TCP from the flange
_CALL = re.compile(r"^(\w+)\s*\((.*)\)$", re.DOTALL)
_ASSIGN = re.compile(r"^(?:global\s+|local\s+)?(\w+)\s*=\s*([^=].*)$", re.DOTALL)
_KEYWORD = re.compile(r"^(\w+)\s*=\s*([^=].*)$", re.DOTALL)


def parse_script(text: str, *, source: str, X_FT: Transform | None = None) -> Program:
    """The motions of a program, poses turned into torch poses.

    Args:
        text: the program.  source: its name, for errors.
        X_FT: flange to the frame that poses are of, in place of what the program sets.
    Raises:
        InputError: a line that cannot be read, a target that is not finite or in millimetres, control flow, no motion.
    """
    reader = _Reader(source, X_FT)
    for number, line in _statements(text, source):
        reader.take(number, line)
    if not reader.motions:
        raise InputError(f"{source}: holds no movej, movel, movep or servoj; there is nothing to check", path=source)
    if len(reader.motions) < 2:
        raise InputError(f"{source}: 1 motion; a path needs two", path=source)
    return Program(
        source=source.rpartition("/")[2],
        kind="script",
        motions=tuple(reader.motions),
        X_FT=reader.mount,
        pauses=reader.pauses,
        notes=tuple(reader.notes),
    )


def _statements(text: str, source: str) -> list[tuple[int, str]]:
    """Line number and text of each statement: comments dropped, lines with open brackets joined."""
    out, held, start = [], "", 0
    for number, line in enumerate(text.splitlines(), 1):
        line = re.sub(r'("[^"]*")|#.*', lambda match: match[1] or "", line).strip()
        if not line:
            continue
        held, start = (f"{held} {line}", start) if held else (line, number)
        if held.count("(") + held.count("[") <= held.count(")") + held.count("]"):
            out.append((start, held))
            held = ""
    if held:
        raise InputError(f"{source}: line {start}: a bracket is never closed", path=source, line=start)
    return out


class _Reader:
    """What has been read so far. Attributes: motions; mount (X_FT of the TCP in force); pauses [s]; notes."""

    def __init__(self, source: str, fixed: Transform | None) -> None:
        self.source, self.fixed, self.mount = source, fixed, fixed or X_FT
        self.motions: list[Motion] = []
        self.notes: list[str] = []
        self.pauses = 0.0
        self.names: dict[str, Value] = {}
        self.arc, self.ignored, self.said_tcp = False, set(), False

    def take(self, number: int, line: str) -> None:
        """One statement."""
        word = re.split(r"\W", line, maxsplit=1)[0]
        if word in SILENT:
            self.ignored |= set(re.findall(r"^def\s+(\w+)", line))
            return
        if word in BLOCKS:
            raise self.wrong(number, f"{word}: which motions follow cannot be told beforehand; give a program without control flow")
        if (call := _CALL.match(line)) is not None:
            self._call(number, call[1], call[2])
        elif (given := _ASSIGN.match(line)) is not None:
            self._assign(number, given[1], given[2])
        else:
            raise self.wrong(number, f"{line[:60]!r} is no statement that is understood")

    def wrong(self, number: int, message: str) -> InputError:
        return InputError(f"{self.source}: line {number}: {message}", path=self.source, line=number)

    def _assign(self, number: int, name: str, text: str) -> None:
        try:
            self.names[name] = self._value(number, text)
        except InputError:
            # Registers, flags, strings: of no matter unless a motion asks for them.
            self.names[name] = text

    def _call(self, number: int, name: str, inside: str) -> None:
        handlers: dict[str, Callable[[int, str, list[str], dict[str, str]], None]] = {
            **dict.fromkeys(("movej", "movel", "movep", "servoj"), self._motion),
            "set_tcp": self._tcp,
            "sleep": self._sleep,
            "set_digital_out": self._output,
            "set_standard_digital_out": self._output,
            "set_tool_digital_out": self._output,
            "set_configurable_digital_out": self._output,
        }
        if name in MOVING:
            raise self.wrong(number, f"{name}: its motion is not checked; use movej, movel, movep or servoj")
        if name in handlers:
            plain, keyed = [], {}
            for part in _parts(inside):
                match = _KEYWORD.match(part)
                if match:
                    keyed[match[1]] = match[2]
                else:
                    plain.append(part)
            handlers[name](number, name, plain, keyed)
        elif name not in self.ignored:
            self.ignored.add(name)
            self.notes.append(f"line {number}: {name} does not move the arm and is passed over")

    def _motion(self, number: int, name: str, plain: list[str], keyed: dict[str, str]) -> None:
        if not plain:
            raise self.wrong(number, f"{name} without a target")
        target = self._value(number, plain[0])
        if not isinstance(target, tuple) or len(target[1]) != 6:
            raise self.wrong(number, f"{name}: the target must be p[x, y, z, rx, ry, rz] or [six joint angles]")
        order = {"servoj": ("a", "v", "t")}.get(name, ("a", "v", "t", "r"))
        given = {key: self._number(number, text) for key, text in (*zip(order, plain[1:], strict=False), *keyed.items())}
        speed, acceleration = DEFAULTS[name]
        if name == "servoj":
            speed = acceleration = 0.0
        else:
            speed, acceleration = given.get("v", speed), given.get("a", acceleration)
            if not (speed > 0 and acceleration > 0):
                raise self.wrong(number, f"{name}: speed {speed:g} and acceleration {acceleration:g} must be positive")
        t = given.get("t", 0.008 if name == "servoj" else 0.0)
        if not (np.isfinite(t) and t >= 0) or (name == "servoj" and t == 0):
            raise self.wrong(number, f"{name}: time {t:g} s must be positive")
        q, X_BT = None, None
        if target[0] == "p":
            X_BT = self._torch(number, target[1])
        else:
            q = np.array(target[1])
            if np.abs(q).max() > 8 * np.pi:
                raise self.wrong(number, f"{name}: a joint at {np.abs(q).max():.4g} rad: looks like degrees")
        self.motions.append(
            Motion(command=name, line=number, q=q, X_BT=X_BT, speed=speed, acceleration=acceleration, t=t, arc=self.arc)  # type: ignore[arg-type]
        )

    def _torch(self, number: int, pose: tuple[float, ...]) -> Transform:
        """X_BT of a pose of the TCP in force; the torch hangs on the flange whatever the TCP is."""
        p, turn = np.array(pose[:3]), np.array(pose[3:])
        if np.linalg.norm(p) > FURTHEST:
            raise self.wrong(number, f"{np.linalg.norm(p):.4g} m from the base (limit {FURTHEST:g} m): looks like millimetres")
        if np.linalg.norm(turn) > 2 * np.pi + 1e-6:
            raise self.wrong(number, f"rotation vector of length {np.linalg.norm(turn):.4g} (limit 2 pi): looks like degrees")
        if not self.said_tcp and self.fixed is None:
            self.said_tcp = True
            self.notes.append(
                "the program sets no TCP before its first pose: poses are read as the wire's tip (--tool tool0 otherwise)"
            )
        X_BF = Transform.from_rotation_vector("BT", turn, p) @ self.mount.inverse()
        return X_BF @ X_FT

    def _tcp(self, number: int, _: str, plain: list[str], keyed: dict[str, str]) -> None:
        pose = self._value(number, (plain or list(keyed.values()) or [""])[0])
        if not isinstance(pose, tuple) or len(pose[1]) != 6:
            raise self.wrong(number, "set_tcp: p[x, y, z, rx, ry, rz] is needed")
        p, turn = (float(np.linalg.norm(part)) for part in (pose[1][:3], pose[1][3:]))
        if p > LONGEST_TOOL:
            raise self.wrong(number, f"set_tcp: {p:.4g} m from the flange (limit {LONGEST_TOOL:g} m): looks like millimetres")
        if turn > 2 * np.pi + 1e-6:
            raise self.wrong(number, f"set_tcp: rotation vector of length {turn:.4g} (limit 2 pi): looks like degrees")
        self.said_tcp = True
        if self.fixed is None:
            self.mount = Transform.from_rotation_vector("FT", np.array(pose[1][3:]), np.array(pose[1][:3]))

    def _sleep(self, number: int, _: str, plain: list[str], keyed: dict[str, str]) -> None:
        t = self._number(number, (plain or list(keyed.values()) or ["0"])[0])
        if t < 0:
            raise self.wrong(number, f"sleep: {t:g} s must not be negative")
        self.pauses += t

    def _output(self, _number: int, _: str, plain: list[str], keyed: dict[str, str]) -> None:
        words = [*plain, *keyed.values()]
        self.arc = bool(words) and words[-1].strip() == "True"

    def _number(self, number: int, text: str) -> float:
        value = self._value(number, text)
        if not isinstance(value, float):
            raise self.wrong(number, f"{text[:40]!r} is no number")
        return value

    def _value(self, number: int, text: str) -> Value:
        """A finite number, a pose ("p", six numbers) or a list ("", numbers)."""
        text = text.strip()
        if isinstance(known := self.names.get(text), float | tuple):
            return known
        kind = "p" if re.match(r"^p\s*\[", text) else ""
        try:
            tree = ast.parse(text[1:].strip() if kind else text, mode="eval").body
            if isinstance(tree, ast.List):
                return kind, tuple(self._arithmetic(item) for item in tree.elts)
            return self._arithmetic(tree)
        except (SyntaxError, ValueError, ZeroDivisionError, OverflowError, RecursionError, MemoryError) as error:
            reason = f": {error}" if isinstance(error, ValueError) else ""
            raise self.wrong(number, f"{text[:60]!r} cannot be read{reason}") from None

    def _arithmetic(self, node: ast.expr) -> float:
        """The finite number that an expression of numbers, names, + - * / and d2r stands for. Raises ValueError."""
        value: float
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                value = float(number)
            case ast.Name(id="pi"):
                value = np.pi
            case ast.Name(id=name) if isinstance(self.names.get(name), float):
                value = self.names[name]  # type: ignore[assignment]
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                value = -self._arithmetic(inner)
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                value = self._arithmetic(inner)
            case ast.Call(func=ast.Name(id="d2r"), args=[inner]):
                value = np.deg2rad(self._arithmetic(inner))
            case ast.BinOp(left=left, op=operator, right=right):
                a, b = self._arithmetic(left), self._arithmetic(right)
                operations = {ast.Add: lambda: a + b, ast.Sub: lambda: a - b, ast.Mult: lambda: a * b, ast.Div: lambda: a / b}
                if type(operator) not in operations:
                    raise ValueError("only + - * / are understood")
                value = operations[type(operator)]()
            case _:
                raise ValueError("a number is needed")
        if not np.isfinite(value):
            raise ValueError("not finite")
        return float(value)


def _parts(inside: str) -> list[str]:
    """Arguments, split at commas outside brackets."""
    out, depth, held = [], 0, ""
    for mark in inside:
        depth += (mark in "([") - (mark in ")]")
        if mark == "," and depth == 0:
            out.append(held.strip())
            held = ""
        else:
            held += mark
    return [*out, held.strip()] if held.strip() else out
