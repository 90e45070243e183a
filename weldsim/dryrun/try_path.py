"""A torch path tried: every waypoint judged on its own, then the whole motion planned."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.dryrun.cell import Cell
from weldsim.dryrun.verdict import Trial, Verdict, Why
from weldsim.errors import MotionError
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT, JOINT_NAMES
from weldsim.motion.config import MotionConfig
from weldsim.motion.plan import MotionPlan, plan_motion
from weldsim.motion.rail import Rail, make_rail
from weldsim.motion.rungs import Rungs, make_rungs, places
from weldsim.mounts import X_FT
from weldsim.records import TorchPath

FINE = 0.001  # [m] to which the first place that fails is found
FASTEST = 0.25  # [m/s] greatest torch speed with the arc, the safety limit of manual mode
JUMP = np.deg2rad(2.0)  # [rad] two poses may always differ by so much
COARSE_ROLLS = 18  # rotations about the wire of a coarse look


def try_path(path: TorchPath, name: str, cell: Cell, config: MotionConfig) -> Trial:
    """A verdict for every waypoint of the path, and the motion where it can be done."""
    points, length = path.X_BT.p, float(path.s[-1] - path.s[0])
    base = Trial(name=name, verdicts=_all(path), points_B=points, length=length)
    spoilt = _spoilt(path, cell, config)
    if spoilt is not None:
        first, why, text = spoilt
        return replace(base, verdicts=_marked(path, {first: (why, text)}, after=first), p_worst=points[first])
    try:
        rail = make_rail(path, config)
    except MotionError as error:
        index = int(str(error.data.get("index", 0)))
        return replace(base, verdicts=_marked(path, {index: ("orientation jump", str(error))}, after=index), p_worst=points[index])
    rungs = make_rungs(rail, X_FT, config, cell.collision)
    if rungs.first_refused is not None:
        return _refused(base, path, rail, rungs, cell, config)
    try:
        plan = plan_motion(path, cell.q_start, config, blocked=cell.collision)
    except MotionError as error:
        return _failed(base, path, error, rungs)
    return _planned(base, path, plan, config)


def _all(path: TorchPath) -> tuple[Verdict, ...]:
    return tuple(Verdict(label=f"pose {i}", index=i, s=float(s)) for i, s in enumerate(path.s))


def _marked(path: TorchPath, bad: dict[int, tuple[Why, str]], after: int | None = None) -> tuple[Verdict, ...]:
    """Verdicts with some poses failed and, from `after` on, the others not reached."""
    out = []
    for verdict in _all(path):
        if verdict.index in bad:
            why, text = bad[verdict.index]
            out.append(replace(verdict, why=why, text=text))
        elif after is not None and verdict.index > after:
            out.append(replace(verdict, why="not reached", text=f"the motion ends at pose {after}"))
        else:
            out.append(verdict)
    return tuple(out)


def _spoilt(path: TorchPath, cell: Cell, config: MotionConfig) -> tuple[int, Why, str] | None:
    """What is wrong before any posture is looked for: the start, the speed, jumps of orientation."""
    over = np.abs(cell.q_start) > JOINT_LIMIT
    if over.any():
        joint = int(np.flatnonzero(over)[0])
        degrees = np.rad2deg(cell.q_start[joint])
        return 0, "stale start", f"the arm is said to stand with {JOINT_NAMES[joint]} at {degrees:.0f} deg (limit +-360 deg)"
    if (touch := cell.collision(cell.q_start)) is not None:
        return 0, "stale start", f"where the arm stands {touch}; drive it clear, or say where it really stands (--start)"
    fast = np.flatnonzero(path.speed > FASTEST)
    if len(fast):
        return (
            int(fast[0]),
            "speed",
            f"{1e3 * path.speed[fast[0]]:.0f} mm/s asked for (limit {1e3 * FASTEST:.0f} mm/s with a torch)",
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
        return i + 1, "orientation jump", text
    return None


def _refused(base: Trial, path: TorchPath, rail: Rail, rungs: Rungs, cell: Cell, config: MotionConfig) -> Trial:
    """Poses at which no posture will do, the first found to FINE."""
    refused = np.array([refusal is not None for refusal in rungs.refusals])
    first = int(np.flatnonzero(refused)[0])
    s_first, worst = float(rungs.s[first]), rungs
    if first > 0:
        s = np.linspace(rungs.s[first - 1], rungs.s[first], max(2, int((rungs.s[first] - rungs.s[first - 1]) / FINE) + 2))
        worst = make_rungs(rail, X_FT, config, cell.collision, at=s)
        at = worst.first_refused
        first, s_first = (len(s) - 1, s_first) if at is None else (at, float(s[at]))
    refusal = worst.refusals[first]
    if refusal is None:
        raise AssertionError("a place that was refused is not")
    verdicts = list(_all(path))
    nearest = np.abs(path.s[:, None] - rungs.s[None, :]).argmin(axis=1)
    for i, k in enumerate(nearest):
        mine = rungs.refusals[int(k)]
        if mine is not None and path.s[i] >= s_first - 1e-9:
            verdicts[i] = replace(verdicts[i], why=mine.why, text=mine.text, first=mine.first, second=mine.second, depth=mine.depth)
    lead = "" if rail.start <= s_first <= rail.end else f" on the {'lead-in' if s_first < rail.start else 'lead-out'}"
    index = rail.path_index(s_first)
    text = f"s = {1e3 * s_first:.1f} mm{lead}: {_said(refusal.why, refusal.text, refusal.options, rail)}"
    verdicts[index] = replace(
        verdicts[index], why=refusal.why, text=text, first=refusal.first, second=refusal.second, depth=refusal.depth
    )
    p = rail.at(np.array([s_first])).p[0]
    return replace(
        base,
        verdicts=tuple(verdicts),
        p_worst=p,
        q_worst=refusal.q if refusal.q is not None else _last_posture(rungs, first),
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


def _failed(base: Trial, path: TorchPath, error: MotionError, rungs: Rungs) -> Trial:
    """Every pose has a posture, and yet no motion joins them."""
    s = float(str(error.data.get("s", path.s[0])))
    index = int(np.abs(path.s - s).argmin())
    why: Why = error.data.get("why", "collision")  # type: ignore[assignment]
    split = error.data.get("split", ())
    at = int(np.abs(rungs.s - s).argmin())
    return replace(
        base,
        verdicts=_marked(path, {index: (why, str(error))}, after=index),
        q_worst=_last_posture(rungs, at),
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
    return replace(out, verdicts=_marked(path, {index: ("speed", text)}), p_worst=path.X_BT.p[index])


def quick(path: TorchPath, cell: Cell, config: MotionConfig, length: float = 0.03, turn: float = 0.25) -> bool:
    """Whether a coarse look finds a sweep of the arm along the path: a sieve for many places, not a verdict."""
    from weldsim.motion.ladder import climb

    def blocked(q: Float[ndarray, "6"]) -> str | None:
        return "something" if cell.collision.touches(q) else None

    rail = make_rail(path, config)
    # Its ends first: most places that will not do fail there.
    coarse = replace(config, rolls=min(config.rolls, COARSE_ROLLS))
    if make_rungs(rail, X_FT, coarse, blocked, at=rail.s[[0, -1]]).first_refused is not None:
        return False
    rungs = make_rungs(rail, X_FT, coarse, blocked, at=places(rail, length, turn))
    return rungs.first_refused is None and climb(rungs, cell.q_start, X_FT, config) is not None
