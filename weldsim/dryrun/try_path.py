"""A torch path tried: every waypoint judged on its own, then the whole motion planned."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.verdict import Trial, Verdict, Why
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES
from weldsim.motion.collision import Touch
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import MotionPlan, plan_motion
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.rungs import Refusal, Rungs, make_rungs
from weldsim.records import TorchPath

FINE = 0.001  # [m] to which the first place that fails is found
FASTEST = 0.25  # [m/s] greatest torch speed with the arc, the safety limit of manual mode
JUMP = np.deg2rad(2.0)  # [rad] two poses may always differ by so much
EXACT_ROLLS = 360  # rotations about the wire of the look that refuses


def try_path(path: TorchPath, name: str, cell: Cell, config: MotionConfig) -> Trial:
    """A verdict for every waypoint of the path, and the motion where it can be done."""
    points, length = path.X_BT.p, float(path.s[-1] - path.s[0])
    base = Trial(name=name, verdicts=_all(path), points_B=points, length=length)
    fault = _spoilt(path, cell, config)
    if fault is not None:
        stale = cell.q_start if fault.why == "stale start" else None
        return replace(base, verdicts=_ended(path, fault), p_worst=points[fault.index], q_worst=stale)
    try:
        rail = make_rail(path, config)
    except MotionError as error:
        index = int(str(error.data.get("index", 0)))
        return replace(
            base, verdicts=_ended(path, _Fault(index=index, why="orientation jump", text=str(error))), p_worst=points[index]
        )
    rungs = make_rungs(rail, cell.arm, config, cell.collision)
    if rungs.first_refused is not None:
        found = _first_refused(rail, rungs, cell, config)
        if found is not None:
            return _refused(base, path, rail, rungs, *found)
        config = replace(config, rolls=EXACT_ROLLS)
        rungs = make_rungs(rail, cell.arm, config, cell.collision)
    try:
        plan = plan_motion(path, cell.q_start, config, cell.arm, blocked=cell.collision, rungs=rungs)
    except MotionError as error:
        return _failed(base, path, error, rungs, cell)
    return _planned(base, path, plan, config)


def _all(path: TorchPath) -> tuple[Verdict, ...]:
    return tuple(Verdict(label=f"pose {i}", index=i, s=float(s)) for i, s in enumerate(path.s))


@dataclass(frozen=True, kw_only=True)
class _Fault:
    """Why a pose fails. Attributes: index of the pose; why; text; touch, the bodies where any collide."""

    index: int
    why: Why
    text: str
    touch: Touch | None = None


def _failing(verdict: Verdict, fault: _Fault) -> Verdict:
    first, second, depth = ("", "", 0.0) if fault.touch is None else (fault.touch.first, fault.touch.second, fault.touch.depth)
    return replace(verdict, why=fault.why, text=fault.text, first=first, second=second, depth=depth)


def _ended(path: TorchPath, fault: _Fault) -> tuple[Verdict, ...]:
    """Verdicts of a motion that ends at one pose: those after it are not reached."""
    verdicts = _all(path)
    late = {"why": "not reached", "text": f"the motion ends at pose {fault.index}"}
    return (
        *verdicts[: fault.index],
        _failing(verdicts[fault.index], fault),
        *(replace(verdict, **late) for verdict in verdicts[fault.index + 1 :]),  # type: ignore[arg-type]
    )


def _spoilt(path: TorchPath, cell: Cell, config: MotionConfig) -> _Fault | None:
    """What is wrong before any posture is looked for: the start, the speed, jumps of orientation."""
    over = np.abs(cell.q_start) > JOINT_LIMIT
    if over.any():
        joint = int(np.flatnonzero(over)[0])
        degrees = np.rad2deg(cell.q_start[joint])
        return _Fault(
            index=0,
            why="stale start",
            text=f"the arm is said to stand with {JOINT_NAMES[joint]} at {degrees:.0f} deg (limit +-360 deg)",
        )
    if (touch := cell.collision.touch(cell.q_start)) is not None:
        text = f"where the arm stands {touch}; drive it clear, move the part, or say where it really stands (--start)"
        return _Fault(index=0, why="stale start", text=text, touch=touch)
    fast = np.flatnonzero(path.speed > FASTEST)
    if len(fast):
        return _Fault(
            index=int(fast[0]),
            why="speed",
            text=f"{1e3 * path.speed[fast[0]]:.0f} mm/s asked for (limit {1e3 * FASTEST:.0f} mm/s with a torch)",
        )
    R = path.X_BT.R
    if path.roll_free:
        turn = np.arctan2(np.linalg.norm(np.cross(R[1:, :, 2], R[:-1, :, 2]), axis=1), np.sum(R[1:, :, 2] * R[:-1, :, 2], axis=1))
    else:
        turn = (Transform("BT", R[:-1], np.zeros((len(R) - 1, 3))).inverse() @ Transform("BT", R[1:], np.zeros((len(R) - 1, 3)))).R
        turn = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0))
    ds = np.diff(path.s)
    jumps = np.flatnonzero(turn > np.maximum(JUMP, config.joint_rate * ds))
    if len(jumps):
        i = int(jumps[0])
        limit = np.rad2deg(max(JUMP, config.joint_rate * ds[i]))
        text = f"the torch turns {np.rad2deg(turn[i]):.1f} deg within {1e3 * ds[i]:.1f} mm (limit {limit:.1f} deg); smooth the path"
        return _Fault(index=i + 1, why="orientation jump", text=text)
    return None


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


def _refused(base: Trial, path: TorchPath, rail: Rail, rungs: Rungs, s_first: float, refusal: Refusal) -> Trial:
    """Poses at which no posture will do, the first of them at s_first [m]."""
    verdicts = list(_all(path))
    nearest = np.abs(path.s[:, None] - rungs.s[None, :]).argmin(axis=1)
    for i, k in enumerate(nearest):
        mine = rungs.refusals[int(k)]
        if mine is not None and path.s[i] >= s_first - 1e-9:
            verdicts[i] = _failing(verdicts[i], _Fault(index=i, why=mine.why, text=mine.text, touch=mine.touch))
    lead = "" if rail.start <= s_first <= rail.end else f" on the {'lead-in' if s_first < rail.start else 'lead-out'}"
    index = rail.path_index(s_first)
    text = f"s = {1e3 * s_first:.1f} mm{lead}: {_said(refusal.why, refusal.text, refusal.options, rail)}"
    verdicts[index] = _failing(verdicts[index], _Fault(index=index, why=refusal.why, text=text, touch=refusal.touch))
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
    split, q = error.data.get("split", ()), error.data.get("q", ())
    q_worst = np.array(q) if isinstance(q, tuple) and len(q) == 6 else _last_posture(rungs, int(np.abs(rungs.s - s).argmin()))
    touch = cell.collision.touch(q_worst) if why == "collision" and q_worst is not None else None
    return replace(
        base,
        verdicts=_ended(path, _Fault(index=index, why=why, text=str(error), touch=touch)),
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
    text = (
        f"joint limits allow {100 * plan.slowest:.0f} % of the {1e3 * asked:.0f} mm/s asked for"
        f" ({config.joint_speed_limit:g} rad/s, {config.joint_acceleration_limit:g} rad/s2)"
    )
    index = int(np.abs(path.s - plan.slowest_at).argmin())
    verdicts = list(_all(path))
    verdicts[index] = _failing(verdicts[index], _Fault(index=index, why="speed", text=text))
    return replace(out, verdicts=tuple(verdicts), s_worst=plan.slowest_at, p_worst=path.X_BT.p[index])
