"""A change asked for by the user, as a report names it: torch turned or leaned, part moved, weld slowed down."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell, shifted
from weldsim.dryrun.fix import changed_program, leaned, turned_about_wire
from weldsim.dryrun.program import Given, Program
from weldsim.errors import InputError
from weldsim.records import TorchPath


@dataclass(frozen=True, kw_only=True)
class Change:
    """Attributes: turn about the wire [rad]; lean, added work and travel angle [rad]; move of part and job in B [m]; speed of the
    weld at most [m/s]; each None where it stays as it is."""

    turn: float | None = None
    lean: Float[ndarray, "2"] | None = None
    move: Float[ndarray, "2"] | None = None
    speed: float | None = None


def changed(program: Program, cell: Cell, change: Change) -> tuple[Program, Cell]:
    """The program and the cell with the change made: all its welds, or all its poses.

    Raises:
        InputError: a change that a robot program cannot be given, a speed of zero or less, or a place where the part cannot stand.
    """
    if change.speed is not None and not change.speed > 0:
        raise InputError(f"--speed: {change.speed:g} m/s must be over 0", value=change.speed)
    move = None if change.move is None else np.array([*change.move, 0.0])
    if move is not None and (fault := cell.misplaced(move)) is not None:
        raise InputError(f"--move {_said(move)}: {fault}; {_instead(cell, move)}", value=move[:2].tolist(), fault=fault)
    if program.kind == "script":
        if change.lean is not None or change.speed is not None:
            given = " and ".join(name for name, value in (("--lean", change.lean), ("--speed", change.speed)) if value is not None)
            raise InputError(f"{program.source}: {given}: for paths; a robot program names its own")
        program = changed_program(program, turn=change.turn or 0.0, move=move)
    else:
        program = replace(program, paths=tuple(_changed_path(path, change, move) for path in program.paths))
    lean = (0.0, 0.0) if change.lean is None else (float(change.lean[0]), float(change.lean[1]))
    program = replace(program, given=Given(turn=change.turn or 0.0, lean=lean))
    return program, cell if move is None else cell.moved(move)


def _said(move: Float[ndarray, "_"]) -> str:
    return f'"{1e3 * move[0]:.10g} mm, {1e3 * move[1]:.10g} mm"'


def _instead(cell: Cell, move: Float[ndarray, "3"]) -> str:
    """What to do about a move to where the part cannot stand."""
    place = cell.clear_place(move)
    return "leave the part where it is" if place is None else f"it can stand at {_said(place)}"


def _changed_path(path: TorchPath, change: Change, move: Float[ndarray, "3"] | None) -> TorchPath:
    X_BT, speed = path.X_BT, path.speed
    if change.turn is not None:
        X_BT = turned_about_wire(X_BT, change.turn)
    if change.lean is not None:
        X_BT = leaned(X_BT, float(change.lean[0]), float(change.lean[1]))
    if move is not None:
        X_BT = shifted(X_BT, move)
    if change.speed is not None:
        speed = np.minimum(speed, change.speed)
    return replace(path, X_BT=X_BT, speed=speed)
