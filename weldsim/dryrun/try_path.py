"""A torch path tried: every waypoint judged on its own, then the whole motion planned."""

from dataclasses import replace
from itertools import groupby

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.path_faults import Fault, failing, path_faults
from weldsim.dryrun.sections import kept_poses
from weldsim.dryrun.verdict import Trial, Verdict, Why
from weldsim.errors import MotionError
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import MotionPlan, plan_motion
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.rungs import Refusal, Rungs, make_rungs, places
from weldsim.records import Segment, TorchPath

FINE = 0.001  # [m] to which the first place that fails is found
RAMP_MARGIN = 0.0005  # [m] beside a ramp of the tip's speed in which a pose is not called slow
EXACT_ROLLS = 360  # rotations about the wire of the look that refuses


def try_path(path: TorchPath, name: str, cell: Cell, config: MotionConfig) -> Trial:
    """A verdict for every waypoint of the path, and the motion where it can be done."""
    base = Trial(name=name, verdicts=_all(path), points_B=path.X_BT.p, length=float(path.s[-1] - path.s[0]))
    start, faults = _bad_start(cell), path_faults(path, config)
    if start is not None or faults:
        return _spoilt(base, path, start, faults, cell, config)
    try:
        rail = make_rail(path, config)
    except MotionError as error:
        index = int(str(error.data.get("index", 0)))
        fault = Fault(index=index, why="orientation jump", text=str(error))
        return replace(base, verdicts=_ended(path, [fault]), p_worst=path.X_BT.p[index])
    rungs = make_rungs(rail, cell.arm, config, cell.collision)
    if rungs.first_refused is not None:
        found = _first_refused(rail, rungs, cell, config)
        if found is not None:
            return _refused(base, path, rail, rungs, *found, cell, config)
        config = replace(config, rolls=EXACT_ROLLS)
        rungs = make_rungs(rail, cell.arm, config, cell.collision)
    try:
        plan = plan_motion(path, cell.q_start, config, cell.arm, blocked=cell.collision, rungs=rungs)
    except MotionError as error:
        return _failed(base, path, error, rungs, cell)
    return _planned(base, path, plan, config)


def _all(path: TorchPath) -> tuple[Verdict, ...]:
    return tuple(Verdict(label=f"pose {i}", index=i, s=float(s)) for i, s in enumerate(path.s))


def _ended(path: TorchPath, faults: list[Fault]) -> tuple[Verdict, ...]:
    """Verdicts of a motion that ends at the first of these faults: the poses after it are not reached, but for the others."""
    first = min(fault.index for fault in faults)
    late = {"why": "not reached", "text": f"the motion ends at pose {first}"}
    verdicts = [replace(verdict, **late) if verdict.index > first else verdict for verdict in _all(path)]  # type: ignore[arg-type]
    for fault in faults:
        verdicts[fault.index] = failing(_all(path)[fault.index], fault)
    return tuple(verdicts)


def _bad_start(cell: Cell) -> Fault | None:
    """What is wrong with where the arm stands."""
    over = np.abs(cell.q_start) > JOINT_LIMIT
    if over.any():
        joint = int(np.flatnonzero(over)[0])
        degrees = np.rad2deg(cell.q_start[joint])
        return Fault(
            index=0,
            why="stale start",
            text=f"the arm is said to stand with {JOINT_NAMES[joint]} at {degrees:.0f} deg (limit +-360 deg)",
        )
    if (touch := cell.collision.touch(cell.q_start)) is not None:
        text = f"where the arm stands {touch}; drive it clear, move the part, or say where it really stands (--start)"
        return Fault(index=0, why="stale start", text=text, touch=touch)
    return None


def _spoilt(base: Trial, path: TorchPath, start: Fault | None, faults: list[Fault], cell: Cell, config: MotionConfig) -> Trial:
    """A path with faults of its own: the motion ends at the first, and every pose that fails is named, whatever comes before it."""
    named = {fault.index: fault for fault in [*_refusals(path, cell, config), *faults, *([] if start is None else [start])]}
    first = min(named)
    return replace(
        base,
        verdicts=_ended(path, list(named.values())),
        p_worst=path.X_BT.p[first],
        q_worst=cell.q_start if named[first].why == "stale start" else None,
    )


def _refusals(path: TorchPath, cell: Cell, config: MotionConfig) -> list[Fault]:
    """The poses that no posture will do for, each taken alone."""
    moved = np.concatenate([[True], np.diff(path.s) > 1e-9])
    try:
        rail = make_rail(kept_poses(path, moved), config)
    except MotionError:
        return []
    mine = rail.index >= 0
    apart = places(rail)  # of a dense path not every pose is looked at
    rungs = make_rungs(rail, cell.arm, config, cell.collision, at=rail.s[mine] if mine.sum() < len(apart) else apart)
    kept, out = np.flatnonzero(moved), []
    for index, refusal in zip(rail.index[mine], _refusals_at(rail.s[mine], rail, rungs, cell, config), strict=True):
        if refusal is not None:
            text = _said(refusal.why, refusal.text, refusal.options, rail)
            out.append(Fault(index=int(kept[index]), why=refusal.why, text=text, touch=refusal.touch))
    return out


def _first_refused(rail: Rail, rungs: Rungs, cell: Cell, config: MotionConfig) -> tuple[float, Refusal] | None:
    """The first place where no posture will do, to FINE, among rotations about the wire a degree apart; None where one does."""
    exact = replace(config, rolls=EXACT_ROLLS)
    for i in (i for i, refusal in enumerate(rungs.refusals) if refusal is not None):
        before = rungs.s[max(i - 1, 0)]
        s = np.unique(np.linspace(rungs.s[i], before, int((rungs.s[i] - before) / FINE) + 2)[: -1 if i else None])
        for at, refusal in zip(s, make_rungs(rail, cell.arm, config, cell.collision, at=s).refusals, strict=True):
            if refusal is not None and rail.roll_free:
                refusal = make_rungs(rail, cell.arm, exact, cell.collision, at=np.array([at])).refusals[0]
            if refusal is not None:
                return float(at), refusal
    return None


def _refusals_at(s: Float[ndarray, "n"], rail: Rail, rungs: Rungs, cell: Cell, config: MotionConfig) -> list[Refusal | None]:
    """The refusal of each place [m]: that of the nearest rung of the stretch that it lies in, whose ends are found to FINE."""
    out: list[Refusal | None] = [None] * len(s)
    for refused, run in groupby(range(len(rungs.s)), lambda i: rungs.refusals[i] is not None):
        if not refused:
            continue
        mine = list(run)
        a, b = mine[0], mine[-1]
        low = float(rungs.s[a]) if a == 0 else _border(rail, float(rungs.s[a - 1]), float(rungs.s[a]), cell, config)
        high = float(rungs.s[b])
        if b + 1 < len(rungs.s):
            high = _border(rail, float(rungs.s[b + 1]), high, cell, config)
        for i in np.flatnonzero((s >= low - 1e-9) & (s <= high + 1e-9)):
            out[i] = rungs.refusals[mine[int(np.abs(rungs.s[mine] - s[i]).argmin())]]
    return out


def _border(rail: Rail, clear: float, refused: float, cell: Cell, config: MotionConfig) -> float:
    """The place between one that has a posture and one that has none, nearest to the first and without one, to FINE [m]."""
    exact = replace(config, rolls=EXACT_ROLLS)
    while abs(refused - clear) > FINE:
        at = np.array([(clear + refused) / 2])
        refusal = make_rungs(rail, cell.arm, config, cell.collision, at=at).refusals[0]
        if refusal is not None and rail.roll_free:
            refusal = make_rungs(rail, cell.arm, exact, cell.collision, at=at).refusals[0]
        clear, refused = (float(at[0]), refused) if refusal is None else (clear, float(at[0]))
    return refused


def _refused(
    base: Trial, path: TorchPath, rail: Rail, rungs: Rungs, s_first: float, refusal: Refusal, cell: Cell, config: MotionConfig
) -> Trial:
    """Poses at which no posture will do, the first of them at s_first [m]."""
    verdicts = list(_all(path))
    for i, mine in enumerate(_refusals_at(path.s, rail, rungs, cell, config)):
        if mine is not None and path.s[i] >= s_first - 1e-9:
            verdicts[i] = failing(verdicts[i], Fault(index=i, why=mine.why, text=_given(mine.text, rail), touch=mine.touch))
    lead = "" if rail.start <= s_first <= rail.end else f" on the {'lead-in' if s_first < rail.start else 'lead-out'}"
    index = rail.path_index(s_first)
    text = f"s = {1e3 * s_first:.1f} mm{lead}: {_said(refusal.why, refusal.text, refusal.options, rail)}"
    verdicts[index] = failing(verdicts[index], Fault(index=index, why=refusal.why, text=text, touch=refusal.touch))
    before = int(np.searchsorted(rungs.s, s_first, side="right")) - 1
    return replace(
        base,
        verdicts=tuple(verdicts),
        s_worst=s_first,
        p_worst=rail.at(np.array([s_first])).p[0],
        q_worst=refusal.q if refusal.q is not None else _last_posture(rungs, before),
        lead=bool(lead),
    )


def _said(why: Why, text: str, options: int, rail: Rail) -> str:
    if why == "collision":
        return f"all {options} postures that reach it touch something, the least deep: {text}"
    return _given(text, rail)


def _given(text: str, rail: Rail) -> str:
    """A reason as it is where the rotation about the wire is free, or given."""
    return text if rail.roll_free else text.replace("any rotation", "the given rotation")


def _last_posture(rungs: Rungs, before: int) -> Float[ndarray, "6"] | None:
    """A posture at the last place that has one, to be drawn."""
    for i in range(min(before, len(rungs.s) - 1), -1, -1):
        if np.isfinite(rungs.cost[i]).any():
            return rungs.q[i][np.unravel_index(rungs.cost[i].argmin(), rungs.cost[i].shape)]
    return None


def _failed(base: Trial, path: TorchPath, error: MotionError, rungs: Rungs, cell: Cell) -> Trial:
    """Every pose has a posture, and yet no motion joins them."""
    s = float(str(error.data.get("s", path.s[0])))
    index = int(np.abs(path.s - s).argmin())
    why: Why = error.data.get("why", "collision")  # type: ignore[assignment]
    until = float(str(error.data.get("until", s)))
    split, q = error.data.get("split", ()), error.data.get("q", ())
    q_worst = np.array(q) if isinstance(q, tuple) and len(q) == 6 else _last_posture(rungs, int(np.abs(rungs.s - s).argmin()))
    touch = cell.collision.touch(q_worst) if why == "collision" and q_worst is not None else None
    there = np.flatnonzero((path.s >= s - 1e-9) & (path.s <= until + 1e-9)).tolist()
    return replace(
        base,
        verdicts=_ended(path, [Fault(index=i, why=why, text=str(error), touch=touch) for i in sorted({index, *there})]),
        s_worst=s,
        q_worst=q_worst,
        p_worst=path.X_BT.p[index],
        lead=not float(path.s[0]) + 1e-6 < s < float(path.s[-1]) - 1e-6,
        split=tuple(split) if isinstance(split, tuple) else (),
    )


def _planned(base: Trial, path: TorchPath, plan: MotionPlan, config: MotionConfig) -> Trial:
    """The motion, and the poses at which a joint limit makes it slower than asked."""
    trajectory = plan.trajectory
    out = replace(
        base,
        t=trajectory.t,
        q=trajectory.q,
        arc_on=trajectory.arc_on,
        cycle=float(trajectory.t[-1]),
        notes=plan.notes,
        slowest=plan.slowest,
        trajectory=trajectory,
    )
    if plan.slowest >= config.least_speed:
        return out
    asked = float(path.speed[path.weld].max())
    limits = f"({config.joint_speed_limit:g} rad/s, {config.joint_acceleration_limit:g} rad/s2)"
    slow = _slow_poses(path, plan, config)
    slow[int(np.abs(path.s - plan.slowest_at).argmin())] = plan.slowest
    verdicts = list(_all(path))
    for index, share in slow.items():
        text = f"joint limits allow {100 * share:.0f} % of the {1e3 * asked:.0f} mm/s asked for {limits}"
        verdicts[index] = failing(verdicts[index], Fault(index=index, why="speed", text=text))
    first = min(slow)
    return replace(out, verdicts=tuple(verdicts), s_worst=plan.slowest_at if len(slow) == 1 else None, p_worst=path.X_BT.p[first])


def _slow_poses(path: TorchPath, plan: MotionPlan, config: MotionConfig) -> dict[int, float]:
    """Share of the asked speed at every pose where it is below the least, ramps at the ends of the weld left out."""
    trajectory = plan.trajectory
    welding = np.array([segment == Segment.WELD for segment in trajectory.segments])
    s, speed = trajectory.s[welding], np.gradient(trajectory.s, trajectory.t)[welding]
    ends = np.array([path.s[path.weld][0], path.s[path.weld][-1], *plan.cuts])
    out: dict[int, float] = {}
    for i in np.flatnonzero(path.arc_on):
        share = float(np.interp(path.s[i], s, speed) / path.speed[i])
        if share < config.least_speed and np.abs(ends - path.s[i]).min() > plan.ramp + RAMP_MARGIN:
            out[int(i)] = share
    return out
