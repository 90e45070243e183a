"""Every failure of a path: what lies behind the first one is tried too, section by section, as if the arm had come past it.

A section is a stretch in which every place has a posture and the torch does not jump. Where no sweep of the arm covers one, the
place is a failure, and the rest of the section is tried from there on.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.path_faults import Fault, failing
from weldsim.dryrun.verdict import Trial, Why
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.motion.config import MotionConfig
from weldsim.motion.follow import LostPathError
from weldsim.motion.plan import first_that_holds
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.rungs import Rungs, make_rungs, places
from weldsim.records import TorchPath

JUMPS: tuple[Why, ...] = ("orientation jump",)  # over these no sweep leads


@dataclass(frozen=True, eq=False, kw_only=True)
class _Break:
    """Where a sweep fails. Attributes: fault, of the first pose; s, until, from where to where [m]; q, the posture there [rad]."""

    fault: Fault
    s: float
    until: float
    q: Float[ndarray, "6"] | None


def with_every_failure(trial: Trial, path: TorchPath, cell: Cell, config: MotionConfig, *, rough: bool = False) -> Trial:
    """The trial of a path with all that fails behind its first failure, or before it, named too.

    Args:
        trial: of the path, pose by pose.
        rough: whether the waypoints scatter: where they alone may be why the arm cannot follow them, that is no failure.
    """
    if trial.passed or trial.trajectory is not None:
        return trial  # the whole motion has been looked at
    moved = np.concatenate([[True], np.diff(path.s) > 1e-9])
    kept = np.flatnonzero(moved)
    try:
        rail = make_rail(kept_poses(path, moved), config)
    except MotionError:
        return trial
    faulty = {verdict.index: verdict for verdict in trial.verdicts if not verdict.ok and verdict.why != "not reached"}
    after = np.cumsum(moved) - moved  # the first pose of the rail that is not before each of the path's
    jumps = np.flatnonzero(np.isin(rail.index, [after[i] for i, one in faulty.items() if one.why in JUMPS]))
    at = places(rail)
    for jump in jumps:  # on the way of a jump nobody asks for a posture, but on both sides of it
        at = np.union1d(at[(at <= rail.s[jump - 1]) | (at >= rail.s[jump])], rail.s[[jump - 1, jump]])
    rungs = make_rungs(rail, cell.arm, config, cell.collision, at=at)
    begin = _first_untried(trial, rungs)
    breaks: list[_Break] = []
    for first, last in _sections(rungs, rail.s[jumps]):
        breaks += _breaks(rail, rungs, max(first, begin), last, cell, config, rough)
    return _listed(trial, path, rail, kept, breaks)


def kept_poses(path: TorchPath, kept: ndarray) -> TorchPath:
    """The path with some of its poses. Args: kept (n,), which."""
    return TorchPath(
        X_BT=Transform("BT", path.X_BT.R[kept], path.X_BT.p[kept]),
        s=path.s[kept],
        speed=path.speed[kept],
        arc_on=path.arc_on[kept],
        segments=tuple(segment for segment, keep in zip(path.segments, kept, strict=True) if keep),
        roll_free=path.roll_free,
    )


def _first_untried(trial: Trial, rungs: Rungs) -> int:
    """The first rung behind a sweep that failed on the weld: up to there one has been found."""
    if rungs.first_refused is not None or trial.s_worst is None or trial.lead:
        return 0
    there = [verdict.s for verdict in trial.verdicts if verdict.s is not None and not verdict.ok and verdict.why != "not reached"]
    return int(np.searchsorted(rungs.s, max([trial.s_worst, *there]) + 1e-6))


def _sections(rungs: Rungs, jumps: Float[ndarray, "j"]) -> list[tuple[int, int]]:
    """First and last rung of each stretch of rungs that have a posture; a new one begins at each of the arc lengths `jumps` [m]."""
    begins = set(np.searchsorted(rungs.s, jumps - 1e-9).tolist())
    out: list[tuple[int, int]] = []
    for i, refusal in enumerate(rungs.refusals):
        if refusal is not None:
            continue
        if out and out[-1][1] == i - 1 and i not in begins:
            out[-1] = (out[-1][0], i)
        else:
            out.append((i, i))
    return out


def _breaks(rail: Rail, rungs: Rungs, first: int, last: int, cell: Cell, config: MotionConfig, rough: bool) -> list[_Break]:
    """All places at which sweeps from rung `first` to `last` fail, each swept from behind the one before it."""
    out: list[_Break] = []
    while first < last:
        try:
            section, there = _rail_between(rail, float(rungs.s[first]), float(rungs.s[last])), _rungs_between(rungs, first, last)
            first_that_holds(section, cell.q_start, cell.arm, config, cell.collision, there)
            break
        except MotionError as error:
            found = _break(error, cell)
            excused = rough and isinstance(error.__cause__, LostPathError) and found.fault.why != "collision"
        if not excused:
            out.append(found)
        first = max(first + 1, int(np.searchsorted(rungs.s, found.until + 1e-6)))
    return out


def _break(error: MotionError, cell: Cell) -> _Break:
    s, q = float(str(error.data["s"])), error.data.get("q", ())
    posture = np.array(q) if isinstance(q, tuple) and len(q) == 6 else None
    why: Why = error.data.get("why", "collision")  # type: ignore[assignment]
    touch = cell.collision.touch(posture) if why == "collision" and posture is not None else None
    fault = Fault(index=int(str(error.data["index"])), why=why, text=str(error), touch=touch)
    return _Break(fault=fault, s=s, until=float(str(error.data.get("until", s))), q=posture)


def _rail_between(rail: Rail, a: float, b: float) -> Rail:
    """The rail from arc length a to b [m]; its ends are of the pose nearest to them."""
    inside = (rail.s > a + 1e-9) & (rail.s < b - 1e-9)
    ends = np.array([a, b])
    X_BT = rail.at(ends)
    before = np.clip(np.searchsorted(rail.s, ends, side="right") - 1, 0, len(rail.s) - 2)
    speed = np.minimum(rail.speed[before], rail.speed[before + 1])
    q = X_BT.quaternion * np.where(np.einsum("ij,ij->i", X_BT.quaternion, rail.quaternion[before]) < 0, -1.0, 1.0)[:, None]
    rows = [
        (ends, rail.s[inside]),
        (X_BT.p, rail.p[inside]),
        (q, rail.quaternion[inside]),
        (speed, rail.speed[inside]),
        (np.array([rail.path_index(a), rail.path_index(b)]), rail.index[inside]),
    ]
    s, p, quaternion, speed, index = (np.concatenate([end[:1], middle, end[1:]]) for end, middle in rows)
    start, end = (float(np.clip(edge, a, b)) for edge in (rail.start, rail.end))
    return replace(rail, s=s, p=p, quaternion=quaternion, speed=speed, index=index, start=start, end=end)


def _rungs_between(rungs: Rungs, first: int, last: int) -> Rungs:
    """Rungs from `first` to `last`, both included."""
    mine = slice(first, last + 1)
    return replace(
        rungs,
        s=rungs.s[mine],
        frames=rungs.frames[mine],
        p=rungs.p[mine],
        q=rungs.q[mine],
        cost=rungs.cost[mine],
        refusals=rungs.refusals[mine],
        touches={(key[0] - first, *key[1:]): touch for key, touch in rungs.touches.items() if first <= key[0] <= last},
    )


def _listed(trial: Trial, path: TorchPath, rail: Rail, kept: ndarray, breaks: list[_Break]) -> Trial:
    """The trial with these failures; it is about the one that comes first. Args: kept, the poses of the path that the rail has."""
    before, verdicts = trial.failure, list(trial.verdicts)
    first: _Break | None = None
    for one in breaks:
        index = int(kept[one.fault.index])
        mine = {index, *np.flatnonzero((path.s >= one.s - 1e-9) & (path.s <= one.until + 1e-9)).tolist()}
        for i in sorted(mine):
            if verdicts[i].ok or verdicts[i].why == "not reached":
                verdicts[i] = failing(verdicts[i], replace(one.fault, index=i))
                if (before is None or i < before.index) and first is None:
                    first = one
    if first is None:
        return replace(trial, verdicts=tuple(verdicts))
    place = rail.at(np.array([first.s])).p[0]
    lead = not rail.start + 1e-6 < first.s < rail.end - 1e-6
    return replace(trial, verdicts=tuple(verdicts), s_worst=first.s, q_worst=first.q, p_worst=place, lead=lead, split=())
