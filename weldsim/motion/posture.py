"""Arm postures that could weld a path: every IK branch times rotations about the wire, judged over the whole length."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import MotionError, UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import D1, JOINT_LIMIT, REACH, inverse
from weldsim.motion.arm import clearances, dexterity
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import Rail

HOP = 1.2  # [rad] a joint that turns further between two looks has changed branch
LOOKS, LOOK_TURN, LOOK_LENGTH = 6, 0.4, 0.06  # at least so many looks along a weld, at most so far apart [rad], [m]
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
    solutions: list[Float[ndarray, "_ 6"]], q_start: Float[ndarray, "6"], limit: float
) -> list[Float[ndarray, "_ 6"]]:
    """Joint paths through one solution per look, no joint turning more than HOP, unwrapped near q_start within limit."""
    paths = []
    for first in solutions[0]:
        q = [first + 2 * np.pi * np.round((q_start - first) / (2 * np.pi))]
        for options in solutions[1:]:
            step = (options - q[-1] + np.pi) % (2 * np.pi) - np.pi
            worst = np.abs(step).max(axis=1)
            if len(options) == 0 or worst.min() > HOP:
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
    cost = 0.3 * float(np.abs(q[0] - q_start).max()) + 0.2 * float(np.ptp(q, axis=0).max())
    cost += 4.0 * max(0.0, 1.0 - agile / SHY) ** 2 + 2.0 * max(0.0, 1.0 - to_stop / 1.0) ** 2
    cost += 20.0 * max(0.0, 1.0 - free / max(config.clearance, 1e-9))
    return Posture(q=q, roll=roll, cost=cost, dexterity=agile, clearance=free)


def find_postures(
    rail: Rail, q_start: Float[ndarray, "6"], X_FT: Transform, config: MotionConfig, blocked: Blocked | None = None
) -> list[Posture]:
    """Postures that reach the rail at every look without changing branch, best first; at least one.

    Where no constant rotation about the wire sweeps the whole rail, those that reach its first pose are returned:
    following may still find a way by turning about the wire.

    Raises:
        UnreachableError: a pose that no branch and no roll reaches; `data` has index, s, position, distance, reach.
        MotionError: everything reachable touches something; `data`: index, s, reason.
    """
    looks = _looks(rail)
    X_BT = rail.at(looks)
    X_TF = X_FT.inverse()
    frames = roll_frames(X_BT) if rail.roll_free else X_BT.R
    options: list[tuple[float, list[Float[ndarray, "_ 6"]]]] = []
    for roll in _rolls(rail, config):
        X_BF = Transform("BT", _turned(frames, roll), X_BT.p) @ X_TF
        options.append((roll, [inverse(X_BF[i]) for i in range(len(looks))]))
    reached = np.array([[len(found) > 0 for found in solutions] for _, solutions in options]).any(axis=0)
    if not reached.all():
        # Between the last look reached and the first that is not, find the very pose that fails.
        bad = int(np.flatnonzero(~reached)[0])
        raise unreachable(rail, _first_unreachable(rail, looks[max(bad - 1, 0)], looks[bad], X_TF, config))
    limit = JOINT_LIMIT - config.limit_margin
    postures: list[Posture] = []
    for seen in (len(looks), 1):
        if not postures:
            postures = [
                _judge(q, roll, q_start, X_FT, config)
                for roll, solutions in options
                for q in _follow_branches(solutions[:seen], q_start, limit)
            ]
    return _clear(sorted(postures, key=lambda posture: posture.cost), rail, blocked)


def _clear(postures: list[Posture], rail: Rail, blocked: Blocked | None) -> list[Posture]:
    """The postures that touch nothing at any look. Raises MotionError when there is none."""
    if blocked is None:
        return postures
    touches = [next((touch for q in posture.q if (touch := blocked(q)) is not None), None) for posture in postures]
    clear = [posture for posture, touch in zip(postures, touches, strict=True) if touch is None]
    if clear:
        return clear
    raise MotionError(
        f"path: all {len(postures)} postures that reach it touch something, the best one: {touches[0]};"
        " move the part or the fixture, or change the torch angles",
        index=rail.path_index(rail.start),
        s=rail.start,
        reason=touches[0],
    )


def _looks(rail: Rail) -> Float[ndarray, "m"]:
    """Arc lengths at which postures are judged, near enough for branches to be told apart."""
    R = rail.at(np.linspace(rail.start, rail.end, 64)).R
    turned = R[:, :, 2] if rail.roll_free else R.reshape(len(R), 9) / np.sqrt(2.0)
    turn = float(np.linalg.norm(np.diff(turned, axis=0), axis=1).sum())
    n = max(LOOKS, int(np.ceil(turn / LOOK_TURN)), int(np.ceil((rail.end - rail.start) / LOOK_LENGTH)))
    return np.unique(np.concatenate([np.linspace(rail.start, rail.end, n + 1), rail.s[[0, -1]]]))


def _rolls(rail: Rail, config: MotionConfig) -> list[float]:
    """Rotations about the wire to try [rad]."""
    return [2 * np.pi * k / config.rolls for k in range(config.rolls)] if rail.roll_free else [0.0]


def _first_unreachable(rail: Rail, near: float, far: float, X_TF: Transform, config: MotionConfig) -> float:
    """The smallest arc length in [near, far] that no roll reaches, to 0.5 mm, given that `far` is one."""
    low, high = float(near), float(far)
    while high - low > 0.0005:
        middle = (low + high) / 2
        X_BT = rail.at(np.array([middle]))
        if any(len(inverse((Transform("BT", _turned(X_BT.R, roll), X_BT.p) @ X_TF)[0])) for roll in _rolls(rail, config)):
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
