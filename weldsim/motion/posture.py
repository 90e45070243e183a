"""Arm postures that could weld a path: every IK branch times rotations about the wire, judged over the whole length."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import D1, JOINT_LIMIT, REACH, inverse
from weldsim.motion.arm import clearances, dexterity
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import Rail

HOP = 1.2  # [rad] a joint that turns further between two looks has changed branch
LOOKS = 9  # poses of the rail at which a posture is judged
SHY = 0.12  # [m/rad] dexterity below which a posture is penalised

Blocked = Callable[[Float[ndarray, "6"]], str | None]
"""What a configuration touches, in words, or None: the cell's own collision check, where there is one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Posture:
    """One way to hold the arm along a rail.

    Attributes:
        q: (m, 6) joint angles at the looks, unwrapped [rad].  roll: rotation about the wire [rad].
        cost: less is better.  dexterity: least on the way [m/rad].  clearance: least on the way [m].
    """

    q: Float[ndarray, "m 6"]
    roll: float
    cost: float
    dexterity: float
    clearance: float


def roll_frames(X_BT: Transform) -> Float[ndarray, "m 3 3"]:
    """Rotations whose z is the wire and whose x turns about it as little as possible from pose to pose."""
    frames = [X_BT.R[0]]
    for z in X_BT.R[1:, :, 2]:
        x = frames[-1][:, 0] - (frames[-1][:, 0] @ z) * z
        x /= np.linalg.norm(x)
        frames.append(np.stack([x, np.cross(z, x), z], axis=1))
    return np.stack(frames)


def _turned(R: Float[ndarray, "*m 3 3"], roll: float) -> Float[ndarray, "*m 3 3"]:
    c, s = np.cos(roll), np.sin(roll)
    return R @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _follow_branches(
    solutions: list[Float[ndarray, "k 6"]], q_start: Float[ndarray, "6"], limit: float
) -> list[Float[ndarray, "m 6"]]:
    """Joint paths through one solution per look, no joint turning more than HOP, unwrapped near q_start within limit."""
    paths = []
    for first in solutions[0]:
        q = [first + 2 * np.pi * np.round((q_start - first) / (2 * np.pi))]
        for options in solutions[1:]:
            step = (options - q[-1] + np.pi) % (2 * np.pi) - np.pi
            worst = np.abs(step).max(axis=1)
            if worst.min() > HOP:
                break
            q.append(q[-1] + step[worst.argmin()])
        else:
            path = np.stack(q)
            # A joint beyond its stop is turned back by one whole turn, all along the path.
            path = path - 2 * np.pi * (path.max(axis=0) > limit) + 2 * np.pi * (path.min(axis=0) < -limit)
            if np.abs(path).max() <= limit:
                paths.append(path)
    return paths


def _judge(q: Float[ndarray, "m 6"], roll: float, q_start: Float[ndarray, "6"], X_FT: Transform, config: MotionConfig) -> Posture:
    """The posture with its cost: travel from the start, travel on the way, nearness to singularities, stops and table."""
    agile = float(dexterity(q, X_FT).min())
    free = float(clearances(q, config.floor, X_FT).min())
    to_stop = JOINT_LIMIT - np.abs(q).max()
    cost = 0.3 * float(np.abs(q[0] - q_start).max()) + 0.2 * float(np.abs(np.diff(q, axis=0)).sum(axis=0).max())
    cost += 4.0 * max(0.0, 1.0 - agile / SHY) ** 2 + 2.0 * max(0.0, 1.0 - to_stop / 1.0) ** 2
    cost += 20.0 * max(0.0, 1.0 - free / max(config.clearance, 1e-9))
    return Posture(q=q, roll=roll, cost=cost, dexterity=agile, clearance=free)


def find_postures(
    rail: Rail, q_start: Float[ndarray, "6"], X_FT: Transform, config: MotionConfig, blocked: Blocked | None = None
) -> list[Posture]:
    """Postures that reach the rail at every look without changing branch, best first.

    Raises:
        UnreachableError: a pose that no branch and no roll reaches; `data` has index, s, position, distance, reach.
    """
    looks = np.unique(np.concatenate([np.linspace(rail.start, rail.end, LOOKS - 2), rail.s[[0, -1]]]))
    X_BT = rail.at(looks)
    X_TF = X_FT.inverse()
    frames = roll_frames(X_BT) if rail.roll_free else X_BT.R
    rolls = np.arange(config.rolls) * 2 * np.pi / config.rolls if rail.roll_free else np.zeros(1)
    postures, reached = [], np.zeros(len(looks), bool)
    for roll in rolls:
        X_BF = Transform("BT", _turned(frames, float(roll)), X_BT.p) @ X_TF
        solutions = [inverse(X_BF[i]) for i in range(len(looks))]
        reached |= np.array([len(options) > 0 for options in solutions])
        for q in _follow_branches(solutions, q_start, JOINT_LIMIT - config.limit_margin):
            postures.append(_judge(q, float(roll), q_start, X_FT, config))
    if not reached.all():
        # Between the last look reached and the first that is not, find the very pose that fails.
        bad = int(np.flatnonzero(~reached)[0])
        raise unreachable(rail, _first_unreachable(rail, looks[max(bad - 1, 0)], looks[bad], X_TF, config))
    if blocked is not None:
        postures = [posture for posture in postures if all(blocked(q) is None for q in posture.q)]
    return sorted(postures, key=lambda posture: posture.cost)


def _first_unreachable(rail: Rail, near: float, far: float, X_TF: Transform, config: MotionConfig) -> float:
    """The smallest arc length in [near, far] that no roll reaches, to 0.5 mm, given that `far` is one."""
    low, high = float(near), float(far)
    while high - low > 0.0005:
        middle = (low + high) / 2
        X_BT = rail.at(np.array([middle]))
        rolls = np.arange(config.rolls) * 2 * np.pi / config.rolls if rail.roll_free else np.zeros(1)
        if any(len(inverse((Transform("BT", _turned(X_BT.R, float(roll)), X_BT.p) @ X_TF)[0])) for roll in rolls):
            low = middle
        else:
            high = middle
    return high


def unreachable(rail: Rail, s: float, reason: str = "no joint solution for any rotation about the wire") -> UnreachableError:
    """The error that says where on the path the arm gives up, and what to do."""
    p = rail.at(np.array([s])).p[0]
    distance = float(np.linalg.norm(p - [0.0, 0.0, D1]))
    index = rail.path_index(s)
    where = "lead-in" if s < rail.start - 1e-9 else "lead-out" if s > rail.end + 1e-9 else "weld"
    if not rail.roll_free:
        reason = reason.replace("any rotation", "the given rotation")
    return UnreachableError(
        f"torch at s = {1e3 * s:.1f} mm of the {where} (pose {index}, ({p[0]:.3f}, {p[1]:.3f}, {p[2]:.3f}) m in base):"
        f" {reason}; {distance:.3f} m from the shoulder (reach of the flange {REACH} m); move the part or change the torch angles",
        index=index,
        s=s,
        position=tuple(float(x) for x in p),
        distance=distance,
        reach=REACH,
    )
