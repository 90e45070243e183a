"""What a dry run reads: torch paths, or the motions of a robot program, with where each comes from."""

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.names import Base, Tool
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.records import TorchPath

__all__ = ["Base", "Command", "Motion", "Program", "Tool"]

Command = Literal["movej", "movel", "movep", "movec", "servoj"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """One motion of a robot program.

    Attributes:
        command: its name.  line: where it stands in the file, from 1.
        q: (6,) the joint target [rad], or None.  X_BT: the torch target, or None; one of both is given.
        speed: asked for, of the tip [m/s] or the leading joint [rad/s].  acceleration: likewise.
        t: time asked for [s], 0 where speed rules.  arc: whether the arc burns.
        way: of a movec, a batch of torch poses along its circle, evenly spaced, the last of them X_BT; None of any other.
    """

    command: Command
    line: int
    q: Float[ndarray, "6"] | None
    X_BT: Transform | None
    speed: float
    acceleration: float
    t: float = 0.0
    arc: bool = False
    way: Transform | None = None


@dataclass(frozen=True, kw_only=True)
class Given:
    """Attributes: turn about the wire, and then lean, added work and travel angle, that poses were given by options [rad]."""

    turn: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Program:
    """What a file asks of the arm.

    Attributes:
        source: the file's name.  kind: what it is.
        paths: welds to be planned, and their names; empty for a script.
        lines: of the file, from 1, that the poses of each path stand in; empty where they have none of their own.
        motions: what a script commands, in order; empty otherwise.
        X_FT: flange to the tool that the poses are of.  pauses: time in which a script stands still [s].
        notes: what was assumed, one sentence each.
        given: what the poses were turned and leaned by already.
        from_start: what of a script depends on how the arm stands when it begins, in words; "" where nothing does.
    """

    source: str
    kind: Literal["path", "csv", "script"]
    paths: tuple[TorchPath, ...] = ()
    names: tuple[str, ...] = ()
    lines: tuple[tuple[int, ...], ...] = ()
    motions: tuple[Motion, ...] = ()
    X_FT: Transform = X_FT
    pauses: float = 0.0
    notes: tuple[str, ...] = ()
    given: Given = Given()
    from_start: str = ""
