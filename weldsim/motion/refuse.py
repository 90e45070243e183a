"""Why a weld cannot be held: the place, the reason, and what to do, as errors."""

from dataclasses import replace

import numpy as np

from weldsim.arm import Arm
from weldsim.errors import MotionError, UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import D1, JOINT_LIMIT, JOINT_NAMES, REACH
from weldsim.motion.config import MotionConfig
from weldsim.motion.ladder import break_at, cuts, least_blocked, wound_up
from weldsim.motion.rail import Rail
from weldsim.motion.rungs import Rungs, make_rungs, turned
from weldsim.motion.sweep import Blocked

FINE = 0.001  # [m] to which the place is found where every sweep breaks
CLOSE = 0.0005  # [m] to which the first unreachable place is found


def refused(rail: Rail, rungs: Rungs, arm: Arm, config: MotionConfig, blocked: Blocked | None = None) -> MotionError:
    """The error that says why there is no climb over the rungs; `data`: index, s, reason, why, and split where a cut would help."""
    first = rungs.first_refused
    if first is None:
        between = break_at(rungs, JOINT_LIMIT - config.limit_margin)
        return _broken(rail, rungs, JOINT_LIMIT - config.limit_margin, _closer(rail, rungs, arm, config, blocked, between))
    refusal, s = rungs.refusals[first], float(rungs.s[first])
    if refusal is not None and refusal.why == "unreachable":
        return unreachable(rail, _first_unreachable(rail, float(rungs.s[max(first - 1, 0)]), s, arm, config))
    if refusal is None or refusal.why == "singular":
        return MotionError(
            f"{where(rail, s)}: every joint solution is at a singularity; move the part or change the torch angles",
            index=rail.path_index(s),
            s=s,
            reason="singular",
            why="singular",
        )
    return MotionError(
        f"{where(rail, s)}: all {refusal.options} postures that reach it touch something, the least deep: {refusal.text};"
        " move the part or the fixture, or change the torch angles",
        index=rail.path_index(s),
        s=s,
        reason=refusal.text,
        why="collision",
        touch=refusal.touch,
        q=() if refusal.q is None else tuple(refusal.q),
    )


def _closer(
    rail: Rail, rungs: Rungs, arm: Arm, config: MotionConfig, blocked: Blocked | None, between: tuple[float, float]
) -> tuple[float, float]:
    """Arc lengths FINE apart [m] between which every sweep breaks; as they were where a closer look gets past both."""
    last, after = between
    if after - last <= FINE:
        return between
    near = np.linspace(last, after, int(np.ceil((after - last) / FINE)) + 1)
    at = np.unique(np.concatenate([rungs.s[rungs.s < last - 1e-9], near]))
    close = make_rungs(rail, arm, replace(config, rolls=len(rungs.rolls)), blocked, at=at)
    if (first := close.first_refused) is not None:
        return (float(at[first - 1]), float(at[first])) if first else between
    found = break_at(close, JOINT_LIMIT - config.limit_margin)
    return between if found[0] >= after - 1e-9 else found


def _broken(rail: Rail, rungs: Rungs, limit: float, between: tuple[float, float]) -> MotionError:
    """Every place has a posture, but no continuous motion joins them all; `data`: split, cuts between which motions do [m].

    Args:
        between: arc lengths [m] of the last place that a sweep gets to, and of the next one.
    """
    last, after = between
    split = tuple(cuts(rungs, limit, (rail.start, rail.end)) or ())
    told: dict[str, object] = {"reason": "branch flip", "why": "joint jump"}
    without = "without branch flip"
    if wound := wound_up(rungs, limit):
        told = {"reason": "joint limit", "why": "joint limit"}
        without = f"that keeps {' and '.join(JOINT_NAMES[joint] for joint in wound)} from its end stop"
    elif (blocked := least_blocked(rungs)) is not None:
        at, q, touch = blocked
        told = {"reason": str(touch), "why": "collision", "touch": touch, "q": tuple(q)}
        without = f"clear of obstacles (in the one that touches least, {touch} at s = {1e3 * rungs.s[at]:.1f} mm)"
    advice = "" if split else "; move the part or change the torch angles"
    return MotionError(
        f"{where(rail, after)}: no sweep of the arm {without} goes beyond s = {1e3 * last:.1f} mm{advice}",
        index=rail.path_index(after),
        s=after,
        split=split,
        **told,
    )


def where(rail: Rail, s: float) -> str:
    """The place in words: arc length, piece, pose of the path, position."""
    p = rail.at(np.array([s])).p[0]
    piece = "lead-in" if s < rail.start - 1e-9 else "lead-out" if s > rail.end + 1e-9 else "weld"
    return (
        f"torch at s = {1e3 * s:.1f} mm of the {piece} (pose {rail.path_index(s)}, ({p[0]:.3f}, {p[1]:.3f}, {p[2]:.3f}) m in base)"
    )


def unreachable(rail: Rail, s: float, reason: str = "no joint solution for any rotation about the wire") -> UnreachableError:
    """The error that says where on the path the arm gives up, and what to do."""
    p = rail.at(np.array([s])).p[0]
    distance = float(np.linalg.norm(p - [0.0, 0.0, D1]))
    if not rail.roll_free:
        reason = reason.replace("any rotation", "the given rotation")
    return UnreachableError(
        f"{where(rail, s)}: {reason}; {distance:.3f} m from the shoulder (reach of the flange {REACH} m);"
        " move the part or change the torch angles",
        index=rail.path_index(s),
        s=s,
        reason=reason,
        why="unreachable",
        position=tuple(float(x) for x in p),
        distance=distance,
        reach=REACH,
    )


def _first_unreachable(rail: Rail, near: float, far: float, arm: Arm, config: MotionConfig) -> float:
    """The smallest arc length in [near, far] that no roll reaches, to CLOSE, given that `far` is one."""
    count = config.rolls if rail.roll_free else 1
    low, high, X_TF = near, far, arm.X_FT.inverse()
    while high - low > CLOSE:
        middle = (low + high) / 2
        X_BT = rail.at(np.array([middle]))
        rolls = 2 * np.pi * np.arange(count) / count
        if any(len(arm.inverse((Transform("BT", turned(X_BT.R, float(roll)), X_BT.p) @ X_TF)[0])) for roll in rolls):
            low = middle
        else:
            high = middle
    return high
