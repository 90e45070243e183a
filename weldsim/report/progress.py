"""How far a weld came along its seam and where it was interrupted: by the arc, or by the way where it was not to burn."""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from weldsim.curves import interpolate
from weldsim.quantity import Metre
from weldsim.records import ExecutionLog, Segment, TorchPath, WeldProgress

LAG: Metre = 5e-3  # by which an arm may trail what it is told, along the seam
STEP: Metre = 1e-4  # to which the torch is looked for


def weld_progress(log: ExecutionLog, path: TorchPath, whole: TorchPath, *, arc: bool) -> WeldProgress:
    """What was welded of a seam, and where to go on.

    Where the arc went out the torch itself is looked for, not where it was told to be: an arm trails its commands.

    Args:
        log: what the arm did.  path: what it was to weld.  whole: the path of the whole seam, with the same arc lengths.
        arc: whether the arc was to burn.
    """
    on = np.array(log.arc_on) if arc else np.array([segment == Segment.WELD for segment in log.segments])
    weld, length = path.weld, float(whole.s[whole.weld][-1] - whole.s[whole.weld][0])
    begin = float(path.s[weld][0])
    ends = [(float(log.s_cmd[first]), _reached(log, path, last)) for first, last in _pieces(on)]
    s_to = max((end for _, end in ends), default=begin)
    x, y, z = (float(value) for value in interpolate(path.s, path.X_BT.p, np.array([s_to]))[0])
    return WeldProgress(
        length=length,
        s_from=begin,
        s_to=s_to,
        welded=float(sum(max(0.0, end - start) for start, end in ends)),
        arc=arc,
        position_B=(x, y, z),
    )


def interruptions(log: ExecutionLog) -> tuple[tuple[float, float], ...]:
    """Where the arc went out on the weld and where it was lit again, arc lengths [m]; the second is less where they overlap."""
    pieces = _pieces(log.arc_on)
    return tuple((float(log.s_cmd[a]), float(log.s_cmd[b])) for (_, a), (b, _) in pairwise(pieces))


def _pieces(on: Bool[ndarray, "k"]) -> list[tuple[int, int]]:
    """First and last instant of each piece of weld."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _reached(log: ExecutionLog, path: TorchPath, k: int) -> float:
    """Arc length nearest to the torch tip at an instant, at or a little before the commanded one [m]."""
    told = float(log.s_cmd[k])
    at = np.linspace(max(told - LAG, float(path.s[0])), told, round(LAG / STEP) + 1)
    return float(at[np.linalg.norm(interpolate(path.s, path.X_BT.p, at) - log.X_BT_act.p[k], axis=1).argmin()])
