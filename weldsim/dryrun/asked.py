"""What settings that were given change of a program that was read: its welding speed."""

from dataclasses import replace

import numpy as np

from weldsim.config import CellConfig
from weldsim.dryrun.program import Program
from weldsim.records import Segment, TorchPath


def at_given_speed(program: Program, config: CellConfig) -> Program:
    """The program with its welds at `path.speed` where that was given, whatever the file says; told in a note."""
    if program.kind == "script" or "path.speed" not in config.given:
        return program
    speed, notes = config.path.speed, []
    for name, path in zip(program.names, program.paths, strict=True):
        own = float(np.median(path.speed[_welds(path)]))
        if abs(own - speed) > 1e-9:
            notes.append(f"{name}: at {1e3 * speed:.4g} mm/s, as path.speed says; the file says {1e3 * own:.4g} mm/s")
    paths = tuple(replace(path, speed=np.where(_welds(path), speed, path.speed)) for path in program.paths)
    return replace(program, paths=paths, notes=(*program.notes, *notes)) if notes else program


def _welds(path: TorchPath) -> np.ndarray:
    """Which poses are of the weld."""
    return np.array([segment is Segment.WELD for segment in path.segments])
