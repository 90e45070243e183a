"""A whole dry run: every path or motion of a program tried in a cell, and fixes looked for where one fails."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from weldsim.curves import project
from weldsim.dryrun.cell import Cell
from weldsim.dryrun.fix import fixes_for_path, fixes_for_script
from weldsim.dryrun.margins import margins
from weldsim.dryrun.program import Program
from weldsim.dryrun.stray import strays
from weldsim.dryrun.together import for_all
from weldsim.dryrun.try_script import try_script
from weldsim.dryrun.verdict import DryRun
from weldsim.dryrun.waypoints import try_waypoints
from weldsim.motion.config import MotionConfig
from weldsim.scene.cell import TABLE

BESIDE = 0.005  # [m] of a weld from the scene's seam, from which it may be another part's
FEW = 200  # places of a weld that are looked at


def dry_run(
    program: Program,
    cell: Cell,
    config: MotionConfig | None = None,
    *,
    fix: bool = True,
    tell: Callable[[str, float | None], None] = lambda stage, done: None,
) -> DryRun:
    """What would become of a program in a cell, without anything moving.

    Args:
        program: as `read_program` gives it.  cell: what stands around the arm, and where the arm stands.
        config: of motion planning, for paths.
        fix: whether to look for changes that help.  tell: told what is being done.
    """
    config = config or MotionConfig()
    trials, fixes, all_followed = [], [], []
    if program.kind == "script":
        tell("program", None)
        trials.append(try_script(program, cell))
        fixes.append(fixes_for_script(program, trials[0], cell, lambda done: tell("fixes", done)) if fix else ())
    for path, name in zip(program.paths, program.names, strict=True):
        tell(name, None)
        followed, trial = try_waypoints(path, name, cell, config)
        trials.append(trial)
        told = partial(tell, "fixes")
        fixes.append(fixes_for_path(followed, trial, cell, config, told, given=program.given) if fix else ())
        all_followed.append(followed)
    if len(program.paths) > 1 and any(fixes):
        tell("fixes", None)
        fixes = for_all(fixes, all_followed, trials, cell, config, program.given)
    trials = [replace(trial, margins=margins(trial, cell, config)) for trial in trials]
    notes = (*program.notes, *cell.notes, *_beside_table(program, cell), *beside_seams(program, cell), *_astray(program))
    return DryRun(source=program.source, cell=cell.name, trials=tuple(trials), fixes=tuple(fixes), notes=notes)


def _beside_table(program: Program, cell: Cell) -> list[str]:
    """Seams that lie beyond the table's edges, where the cell does not say what would hold a part there; one sentence each."""
    notes = []
    for path, name in zip(program.paths, program.names, strict=True):
        places = path.X_BT.p[path.weld][:, :2]
        beyond = float(np.maximum(TABLE[0] - places, places - TABLE[1]).max())
        if beyond > 0 and not cell.has_part:
            notes.append(f"{name} goes {1e3 * beyond:.0f} mm beyond the table's edge; what holds the part there is not known")
    return notes


def _astray(program: Program) -> list[str]:
    """Waypoints that lie aside of an otherwise smooth line, one sentence each."""
    notes = []
    for k, (path, name) in enumerate(zip(program.paths, program.names, strict=True)):
        for stray in strays(path):
            line = f" (line {program.lines[k][stray.index]})" if program.lines else ""
            notes.append(
                f"{name}: pose {stray.index}{line} lies {1e3 * stray.aside:.1f} mm aside of the line through its neighbours; is"
                " it where it is meant to be?"
            )
    return notes


def beside_seams(program: Program, cell: Cell) -> list[str]:
    """Welds that lie off every seam of the scene's part: perhaps another part's, or it stands elsewhere; one sentence each."""
    notes = []
    for path, name in zip(program.paths, program.names, strict=True):
        weld = path.X_BT.p[path.weld]
        weld = weld[:: max(1, len(weld) // FEW)]
        off = [project(weld, seam)[0] for seam in cell.seams]
        if off and (far := float(np.quantile(np.min(off, axis=0), 0.95))) > BESIDE:
            notes.append(
                f"{name} lies up to {1e3 * far:.0f} mm off the nearest seam of the part in {cell.name}: is it that part's, and does"
                " the part stand there?"
            )
    return notes
