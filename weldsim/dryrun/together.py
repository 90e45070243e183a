"""Fixes of a job with several paths: an option changes all of them, so each is tried on the others too."""

from collections.abc import Sequence
from dataclasses import replace

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.fix import applied
from weldsim.dryrun.program import Given
from weldsim.dryrun.try_path import try_path
from weldsim.dryrun.verdict import Fix, Trial
from weldsim.motion.config import MotionConfig
from weldsim.records import TorchPath


def for_all(
    fixes: Sequence[tuple[Fix, ...]],
    paths: Sequence[TorchPath],
    trials: Sequence[Trial],
    cell: Cell,
    config: MotionConfig,
    given: Given,
) -> list[tuple[Fix, ...]]:
    """The fixes of each path, those first after which every path passes; of any other `breaks` says which fail with it.

    Args:
        fixes: of each path, found for it alone.  paths, trials: all of the job, in the same order.
    """
    out = []
    for i, of_path in enumerate(fixes):
        told = [replace(fix, breaks=_failing(fix, i, paths, trials, cell, config, given)) for fix in of_path]
        out.append(tuple(sorted(told, key=lambda fix: bool(fix.breaks))))
    return out


def _failing(
    fix: Fix, own: int, paths: Sequence[TorchPath], trials: Sequence[Trial], cell: Cell, config: MotionConfig, given: Given
) -> tuple[str, ...]:
    """Names of the paths that fail with a change, other than the one that it was found for."""
    out = []
    for j, (path, trial) in enumerate(zip(paths, trials, strict=True)):
        if j == own:
            continue
        if fix.kind == "cut the weld":  # of one path alone
            passed = trial.passed
        else:
            pieces, changed, settings = applied(fix, path, cell, config, given=given)
            passed = all(try_path(piece, trial.name, changed, settings).passed for piece in pieces)
        if not passed:
            out.append(trial.name)
    return tuple(out)
