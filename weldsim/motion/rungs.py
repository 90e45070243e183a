"""The rungs of the ladder that a weld climbs: at places along the rail, every way the arm can hold the torch.

A place, a rotation about the wire and one of eight branches name a joint solution. A branch is told by three signs, those of the
factors of the UR arm's Jacobian determinant (elbow, wrist, shoulder): it cannot be left without passing a singularity.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from weldsim.arm import Arm
from weldsim.frames import Transform
from weldsim.kinematics import A2, A3, D5
from weldsim.motion.arm import clearances, dexterity
from weldsim.motion.collision import NEAR, CellCollision, Touch
from weldsim.motion.config import MotionConfig
from weldsim.motion.rail import Rail
from weldsim.motion.sweep import Blocked

TURN, LENGTH = 0.12, 0.012  # [rad], [m] between rungs, at most
SHY = 0.12  # [m/rad] dexterity below which a posture is penalised
SINGULAR = 0.012  # [m/rad] dexterity below which it is not used
SPEEDLESS = 1e-3  # [m] gaps count as at least this

Why = Literal["unreachable", "singular", "collision"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Refusal:
    """Why no posture will do at a place.

    Attributes:
        why: kind.  text: for people.  options: postures tried.
        q: the posture that comes nearest to doing [rad], None where the place is out of reach or there are only lost ones.
        touch: what collides in it, where something does.
    """

    why: Why
    text: str
    options: int = 0
    q: Float[ndarray, "6"] | None = None
    touch: Touch | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Rungs:
    """Postures along a rail.

    Attributes:
        s: (w,) arc lengths [m].  frames: (w, 3, 3) R_BT at rotation 0 about the wire.  p: (w, 3) tips [m].
        rolls: (r,) rotations about the wire [rad], evenly spaced over the whole turn, or 0 alone.
        q: (w, r, 8, 6) joint angles in (-pi, pi], NaN where the branch has no solution.
        cost: (w, r, 8) less is better, inf where the posture cannot be used.
        refusals: one for each place, None where some posture will do.
        touches: by (place, rotation, branch), what the postures touch that cannot be used for that alone.
    """

    s: Float[ndarray, "w"]
    frames: Float[ndarray, "w 3 3"]
    p: Float[ndarray, "w 3"]
    rolls: Float[ndarray, "r"]
    q: Float[ndarray, "w r 8 6"]
    cost: Float[ndarray, "w r 8"]
    refusals: tuple[Refusal | None, ...]
    touches: Mapping[tuple[int, ...], Touch] = field(default_factory=dict)

    @property
    def first_refused(self) -> int | None:
        """Index of the first place where no posture will do."""
        return next((i for i, refusal in enumerate(self.refusals) if refusal is not None), None)


def make_rungs(
    rail: Rail, arm: Arm, config: MotionConfig, blocked: Blocked | None = None, at: Float[ndarray, "w"] | None = None
) -> Rungs:
    """Every posture at places along the rail near enough to each other, judged.

    Args:
        arm: whose postures.  at: the places [m], by default at most LENGTH and TURN apart.
    """
    s = places(rail) if at is None else at
    X_BT = rail.at(s)
    count = config.rolls if rail.roll_free else 1
    rolls = 2 * np.pi * np.arange(count) / count
    frames = roll_frames(X_BT) if rail.roll_free else X_BT.R
    q = np.full((len(s), count, 8, 6), np.nan)
    R, p = turned(np.repeat(frames, count, axis=0), np.tile(rolls, len(s))), np.repeat(X_BT.p, count, axis=0)
    solutions, pose = arm.inverse_of_many((Transform("BT", R, p) @ arm.X_FT.inverse()).matrix)
    there = np.isfinite(solutions).all(axis=1)
    lost = np.bincount(pose[~there] // count, minlength=len(s))  # at a singularity
    solutions, pose = solutions[there], pose[there]
    q[pose // count, pose % count, branch_of(solutions)] = solutions
    cost, touches = _obstacle_cost(q, _posture_cost(q, arm.X_FT, config), blocked)
    refusals = tuple(_refusal(i, q[i], cost[i], touches, int(lost[i])) for i in range(len(s)))
    return Rungs(s=s, frames=frames, p=X_BT.p, rolls=rolls, q=q, cost=cost, refusals=refusals, touches=touches)


def branch_of(q: Float[ndarray, "*n 6"]) -> Int[ndarray, "*n"]:
    """0 to 7: which of the eight sheets of joint space, divided by the singularities, each q [rad] lies on."""
    reach = A2 * np.cos(q[..., 1]) + A3 * np.cos(q[..., 1] + q[..., 2]) + D5 * np.sin(q[..., 1] + q[..., 2] + q[..., 3])
    return 1 * (np.sin(q[..., 2]) < 0) + 2 * (np.sin(q[..., 4]) < 0) + 4 * (reach < 0)


def turned(R: Float[ndarray, "*m 3 3"], roll: Float[ndarray, "*m"] | float) -> Float[ndarray, "*m 3 3"]:
    """The frames turned by `roll` [rad] about their own z."""
    c, s = np.cos(roll), np.sin(roll)
    zero, one = np.zeros_like(c), np.ones_like(c)
    turn = np.stack([np.stack([c, -s, zero], -1), np.stack([s, c, zero], -1), np.stack([zero, zero, one], -1)], -2)
    return R @ turn


def roll_frames(X_BT: Transform) -> Float[ndarray, "m 3 3"]:
    """Rotations whose z is the wire and whose x turns about it as little as possible from pose to pose."""
    frames = [X_BT.R[0]]
    for z in X_BT.R[1:, :, 2]:
        x = frames[-1][:, 0] - (frames[-1][:, 0] @ z) * z
        x /= np.linalg.norm(x)
        frames.append(np.stack([x, np.cross(z, x), z], axis=1))
    return np.stack(frames)


def places(rail: Rail, length: float = LENGTH, turn: float = TURN) -> Float[ndarray, "w"]:
    """Arc lengths from end to end of the rail, at most `length` [m] and `turn` [rad] of the torch apart."""
    s = np.linspace(rail.s[0], rail.s[-1], max(2, int((rail.s[-1] - rail.s[0]) / 0.0005)))
    R = rail.at(s).R
    turning = R[:, :, 2] if rail.roll_free else R.reshape(len(R), 9) / np.sqrt(2.0)
    stride = np.maximum(np.diff(s) / length, np.linalg.norm(np.diff(turning, axis=0), axis=1) / turn)
    gone = np.concatenate([[0.0], np.cumsum(stride)])
    return np.unique(np.interp(np.linspace(0.0, gone[-1], max(3, int(np.ceil(gone[-1])) + 1)), gone, s))


def _posture_cost(q: Float[ndarray, "w r 8 6"], X_FT: Transform, config: MotionConfig) -> Float[ndarray, "w r 8"]:
    """Cost of each posture by singularities and the table."""
    there = ~np.isnan(q[..., 0])
    cost = np.full(there.shape, np.inf)
    agile = np.zeros(there.shape)
    if there.any():
        agile[there] = dexterity(q[there], X_FT)
        cost[there] = 2.0 * (SHY / np.clip(agile[there], SINGULAR, SHY)) - 2.0
    if there.any() and config.clearance > 0:
        cost[there] += 20.0 * np.clip(1.0 - clearances(q[there], config.floor, X_FT) / config.clearance, 0.0, 1.0)
    cost[there & (agile < SINGULAR)] = np.inf
    return cost


def _obstacle_cost(
    q: Float[ndarray, "w r 8 6"], clear: Float[ndarray, "w r 8"], blocked: Blocked | None
) -> tuple[Float[ndarray, "w r 8"], dict[tuple[int, ...], Touch]]:
    """The cost with obstacles, and what the postures touch that they forbid."""
    cost, touches = clear.copy(), {}
    if blocked is not None:
        for index in zip(*np.nonzero(np.isfinite(cost)), strict=True):
            found, gap = _touch(q[index], blocked)
            if found is not None:
                cost[index] = np.inf
                touches[tuple(int(i) for i in index)] = found
            else:
                cost[index] += 0.5 * (NEAR / max(gap, SPEEDLESS) - 1.0)
    return cost, touches


def _touch(q: Float[ndarray, "6"], blocked: Blocked) -> tuple[Touch | None, float]:
    """What q touches, or None; and the gap to the nearest body [m]."""
    if isinstance(blocked, CellCollision):
        touch = blocked.touch(q)
        return touch, blocked.gap(q) if touch is None else 0.0
    text = blocked(q)
    return (None if text is None else Touch(first=text, second="", depth=0.0)), NEAR


def _refusal(
    i: int, q: Float[ndarray, "r 8 6"], cost: Float[ndarray, "r 8"], touches: Mapping[tuple[int, ...], Touch], lost: int
) -> Refusal | None:
    """Why no posture of one place will do, None where one will. Args: lost, how many have no joint angles, being singular."""
    if np.isfinite(cost).any():
        return None
    there = ~np.isnan(q[..., 0])
    if not there.any() and not lost:
        return Refusal(why="unreachable", text="no joint solution for any rotation about the wire")
    mine = {index[1:]: touch for index, touch in touches.items() if index[0] == i}
    if mine:
        index, touch = min(mine.items(), key=lambda item: item[1].depth)
        return Refusal(why="collision", text=str(touch), options=len(mine), q=q[index], touch=touch)
    text = "every joint solution is at a singularity"
    return Refusal(why="singular", text=text, options=int(there.sum()) + lost, q=q[there][0] if there.any() else None)
