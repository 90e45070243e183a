"""One continuous way to hold the arm along a whole weld: the cheapest climb over rungs of joint solutions (dynamic programming).

The graph has a rung for each place along the rail, on it a node for each rotation about the wire and each branch of the inverse
kinematics. An edge joins neighbouring rungs within one branch, so branches are never changed; whole turns of a joint follow from
continuity, and become nodes of their own only for a joint that would run into its stop (Descartes planning of semi-constrained
paths, after the ladder graph of De Maeyer, Moyaers and Demeester 2017).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from weldsim.arm import Arm
from weldsim.frames import Transform
from weldsim.kinematics import JOINT_LIMIT
from weldsim.motion.collision import Touch
from weldsim.motion.config import MotionConfig
from weldsim.motion.rungs import Rungs, branch_of, turned
from weldsim.motion.sweep import Blocked

STEP = 0.6  # [rad] a joint that turns further between two rungs has jumped
TWIST = 2  # steps of rotation about the wire between two rungs, at most
TRAVEL, ROLLING, STARTING, STANDING = (
    0.2,
    0.15,
    0.3,
    4.0,
)  # weights of joint travel, roll travel, way from the start, mean node cost
TOUCHING, TOUCH_DEPTH = 1e3, 1e-5  # cost of a posture that touches something, and [m] that costs one more, among blocked climbs
SMOOTHINGS = (3.0, 1.5, 0.7, 0.0)  # rungs over which the rotation about the wire is smoothed, tried in order
COMFORT = 0.6  # [rad] from a joint's end stop at which it begins to count
CRAMPED = 3 * np.pi  # [rad] of travel from the start worth taking so as not to weld at a stop: a whole turn from a third of COMFORT

Nodes = Float[ndarray, "r 8 v"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Hold:
    """A climb.

    Attributes:
        s: (w,) arc lengths of the rungs [m].  q: (w, 6) joint angles, continuous and within limits [rad].
        roll: (w,) rotation about the wire [rad], continuous.  branch: 0 to 7.  cost: less is better.
        rest: q(s), what the arm is drawn to while it follows the rail.
    """

    s: Float[ndarray, "w"]
    q: Float[ndarray, "w 6"]
    roll: Float[ndarray, "w"]
    branch: int
    cost: float
    rest: CubicSpline


@dataclass(frozen=True, eq=False, kw_only=True)
class _Climb:
    """Costs of the best way to every node from one end. Attributes: total, (w, r, 8, v), inf where there is none; shift, turn:
    steps of rotation and index of whole turns that the best way came from; offsets (v, 6) whole turns [rad]."""

    total: Float[ndarray, "w r 8 v"]
    shift: ndarray
    turn: ndarray
    offsets: Float[ndarray, "v 6"]


def climb(
    rungs: Rungs,
    q_start: Float[ndarray, "6"],
    arm: Arm,
    config: MotionConfig,
    blocked: Blocked | None = None,
    banned: Bool[ndarray, "w r 8"] | None = None,
) -> Hold | None:
    """The cheapest climb from the first rung to the last, or None where there is none.

    Args:
        q_start: where the arm comes from [rad].  arm: which one.  banned: nodes that have been seen not to do.
    """
    limit = JOINT_LIMIT - config.limit_margin
    cost = rungs.cost if banned is None else np.where(banned, np.inf, rungs.cost)
    found = _searched(replace(rungs, cost=cost), q_start, limit)
    if found is None:
        return None
    q, roll, branch, best = found
    q, roll = _smoothed(rungs, q, roll, branch, arm, limit, blocked)
    return Hold(s=rungs.s, q=q, roll=roll, branch=branch, cost=best, rest=CubicSpline(rungs.s, q))


def _searched(
    rungs: Rungs, q_start: Float[ndarray, "6"], limit: float
) -> tuple[Float[ndarray, "w 6"], Float[ndarray, "w"], int, float] | None:
    """Joint angles, rotation about the wire, branch and cost of the cheapest climb; None where there is none."""
    wound: tuple[int, ...] = ()  # joints whose whole turns are nodes
    while True:
        search = _forward(rungs.q, rungs.cost, q_start, wound, limit)
        if not np.isfinite(search.total[-1]).any():
            return None
        roll, branch, lifted = _descended(rungs, search)
        q, over = _within(lifted, q_start, wound, limit)
        if q is not None:
            return q, roll, branch, float(search.total[-1].min())
        wound = (*wound, *over)


def cuts(rungs: Rungs, limit: float, weld: tuple[float, float]) -> list[float] | None:
    """Arc lengths [m] at which a weld that no single climb covers is best cut into pieces that each have one.

    Two pieces are cut where both together cost least; where it takes more, each is as long as can be. Where joints would be wound
    up into their end stops the pieces are of one length if that will do.

    Args:
        limit: greatest joint angle [rad].  weld: where it begins and ends [m]: leads are not cut.
    Returns:
        None where no cuts help; an empty list where one climb will do.
    """
    if rungs.first_refused is not None:
        return None
    inside = np.flatnonzero((rungs.s > weld[0] + 1e-9) & (rungs.s < weld[1] - 1e-9))
    up = _ways(rungs)
    if np.isfinite(up[-1]):
        return _wound_cuts(rungs, limit, inside)
    down = _ways(replace(rungs, q=rungs.q[::-1], cost=rungs.cost[::-1]))[::-1]
    if np.isfinite(up[inside] + down[inside]).any():
        return [float(rungs.s[inside][(up[inside] + down[inside]).argmin()])]
    return _longest_pieces(rungs, inside, lambda first: first + int(np.flatnonzero(np.isfinite(_ways(_part(rungs, first))))[-1]))


def _wound_cuts(rungs: Rungs, limit: float, inside: Int[ndarray, "m"]) -> list[float] | None:
    """Cuts of a weld along which joints would be wound up into their end stops."""
    longest = _longest_pieces(rungs, inside, lambda first: _furthest(rungs, first, limit))
    if not longest:
        return longest
    even = inside[np.linspace(0, len(inside) - 1, len(longest) + 2).round().astype(int)[1:-1]]
    edges = [0, *even.tolist(), len(rungs.s) - 1]
    if all(_furthest(rungs, a, limit, b) == b for a, b in pairwise(edges)):
        return [float(s) for s in rungs.s[even]]
    return longest


def _longest_pieces(rungs: Rungs, inside: Int[ndarray, "m"], furthest: Callable[[int], int]) -> list[float] | None:
    """Cuts at rungs of `inside` between pieces that are each as long as can be, `furthest` being the last rung climbed to from one;
    None where they get nowhere."""
    out, first = [], 0
    while (last := furthest(first)) < len(rungs.s) - 1:
        if len(inside) == 0 or last > inside[-1]:  # what is left over is a lead: it needs some of the weld with it
            last = (first + last) // 2
        if last <= first or last not in inside:
            return None
        out.append(float(rungs.s[last]))
        first = last
    return out


def _furthest(rungs: Rungs, first: int, limit: float, end: int | None = None) -> int:
    """The last rung, up to `end`, that can be climbed to from `first` with every joint within its limit."""
    nowhere = np.full(6, np.nan)
    step = len(rungs.s) - 1 if end is None else end
    low, high = first, step + 1  # climbed to, and not
    while high - low > 1:
        good = _searched(_part(rungs, first, step + 1), nowhere, limit) is not None
        low, high = (step, high) if good else (low, step)
        step = (low + high) // 2
    return low


def _part(rungs: Rungs, first: int, end: int | None = None) -> Rungs:
    """Rungs from `first` to before `end`."""
    mine = slice(first, end)
    parts = {name: getattr(rungs, name)[mine] for name in ("s", "frames", "p", "q", "cost", "refusals")}
    return replace(rungs, **parts)


def _ways(rungs: Rungs) -> Float[ndarray, "w"]:
    """Cost of the cheapest way to each rung from the first, end stops apart; inf where there is none."""
    return _forward(rungs.q, rungs.cost, np.full(6, np.nan), (), np.inf).total.min(axis=(1, 2, 3))


def break_at(rungs: Rungs, limit: float) -> tuple[float, float]:
    """Arc length of the last rung that can be climbed to from the first, and of the next one [m]."""
    up = _ways(rungs)
    if np.isfinite(up[-1]):
        last = _furthest(rungs, 0, limit)
    else:
        last = int(np.flatnonzero(np.isfinite(up))[-1]) if np.isfinite(up).any() else 0
    return float(rungs.s[last]), float(rungs.s[min(last + 1, len(rungs.s) - 1)])


def wound_up(rungs: Rungs, limit: float) -> list[int]:
    """Joints that the best climb would turn beyond `limit` [rad]; none where there is no climb at all."""
    search = _forward(rungs.q, rungs.cost, np.full(6, np.nan), (), np.inf)
    if not np.isfinite(search.total[-1]).any():
        return []
    return _within(_descended(rungs, search)[2], np.zeros(6), (), limit)[1]


def least_blocked(rungs: Rungs) -> tuple[int, Float[ndarray, "6"], Touch] | None:
    """Of the climbs that obstacles forbid, the one that touches least: the place where it does so deepest, the posture [rad], and
    what it touches there. None where there would be no climb without obstacles either, or nothing is touched."""
    cost = rungs.cost.copy()
    for index, touch in rungs.touches.items():
        cost[index] = TOUCHING + touch.depth / TOUCH_DEPTH
    search = _forward(rungs.q, cost, np.full(6, np.nan), (), np.inf)
    if not np.isfinite(search.total[-1]).any():
        return None
    roll, branch, _ = _descended(rungs, search)
    nodes = np.rint(roll * len(rungs.rolls) / (2 * np.pi)).astype(int) % len(rungs.rolls)
    touched = [(i, int(r), branch) for i, r in enumerate(nodes) if (i, int(r), branch) in rungs.touches]
    if not touched:
        return None
    node = max(touched, key=lambda node: rungs.touches[node].depth)
    return node[0], rungs.q[node], rungs.touches[node]


def near(rungs: Rungs, hold: Hold, s: float, reach: int = 1) -> Bool[ndarray, "w r 8"]:
    """The nodes about where the hold passes arc length s [m], `reach` steps of rotation to either side, in its branch."""
    out = np.zeros(rungs.cost.shape, bool)
    count = len(rungs.rolls)
    for i in np.unique(np.clip(np.searchsorted(rungs.s, s) + np.array([-1, 0]), 0, len(rungs.s) - 1)):
        middle = round(float(hold.roll[i]) / (2 * np.pi / count))
        out[i, np.arange(middle - reach, middle + reach + 1) % count, hold.branch] = True
    return out


def _forward(
    q: Float[ndarray, "w r 8 6"], cost: Float[ndarray, "w r 8"], q_start: Float[ndarray, "6"], wound: tuple[int, ...], limit: float
) -> _Climb:
    """Cheapest ways from the first rung; q_start of NaN does not count."""
    offsets = np.zeros((3 ** len(wound), 6))
    for k, turns in enumerate(product((0, -1, 1), repeat=len(wound))):
        offsets[k, list(wound)] = 2 * np.pi * np.array(turns)
    round_ = np.ones(6, bool)
    round_[list(wound)] = False
    lifted = q[:, :, :, None, :] + offsets
    share = STANDING / len(q)
    furthest = np.abs(np.nan_to_num(lifted[..., list(wound)])).max(axis=-1, initial=0.0)
    node = share * np.where(furthest > limit, np.inf, cost[..., None] + _cramped(limit - furthest))
    way = 0.0 if np.isnan(q_start).any() else STARTING * np.nan_to_num(_turns(lifted[0] - q_start, round_))
    total, came = [node[0] + way], [(np.zeros(node.shape[1:], np.int16),) * 2]
    twist = min(TWIST, (q.shape[1] - 1) // 2)
    for i in range(1, len(q)):
        best, shift_of, turn_of = np.full(node.shape[1:], np.inf), *(np.zeros(node.shape[1:], np.int16) for _ in range(2))
        for shift, v in product(range(-twist, twist + 1), range(len(offsets))):
            step = _turns(lifted[i] - np.roll(lifted[i - 1], shift, axis=0)[:, :, v : v + 1], round_)
            rolling = ROLLING * abs(shift) * 2 * np.pi / q.shape[1]
            found = np.roll(total[-1], shift, axis=0)[:, :, v : v + 1] + TRAVEL * step + rolling
            better = (step < STEP) & (found < best)
            best[better], shift_of[better], turn_of[better] = found[better], shift, v
        total.append(best + node[i])
        came.append((shift_of, turn_of))
    return _Climb(total=np.stack(total), shift=np.stack([c[0] for c in came]), turn=np.stack([c[1] for c in came]), offsets=offsets)


def _turns(difference: Float[ndarray, "*n 6"], round_: Bool[ndarray, "6"]) -> Float[ndarray, "*n"]:
    """The greatest turn of any joint [rad], the short way round for the joints of `round_`."""
    return np.abs(np.where(round_, (difference + np.pi) % (2 * np.pi) - np.pi, difference)).max(axis=-1)


def _cramped(room: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
    """What it costs to come as near to an end stop as `room` [rad]."""
    return CRAMPED * np.clip(1.0 - room / COMFORT, 0.0, 1.0)


def _descended(rungs: Rungs, search: _Climb) -> tuple[Float[ndarray, "w"], int, Float[ndarray, "w 6"]]:
    """The best way read back from the last rung: rotation about the wire, branch, joint angles with the turns searched."""
    count = len(rungs.rolls)
    r, branch, v = (int(i) for i in np.unravel_index(search.total[-1].argmin(), search.total[-1].shape))
    nodes, rolled = [(r, v)], [0]
    for i in range(len(rungs.s) - 1, 0, -1):
        shift, turn = int(search.shift[i, r, branch, v]), int(search.turn[i, r, branch, v])
        r, v = (r - shift) % count, turn
        nodes.append((r, v))
        rolled.append(rolled[-1] - shift)
    nodes.reverse()
    roll = (np.array(rolled[::-1]) - rolled[-1] + nodes[0][0]) * 2 * np.pi / count
    q = np.stack([rungs.q[i, r, branch] + search.offsets[v] for i, (r, v) in enumerate(nodes)])
    return roll, branch, q


def _within(
    q: Float[ndarray, "w 6"], q_start: Float[ndarray, "6"], wound: tuple[int, ...], limit: float
) -> tuple[Float[ndarray, "w 6"] | None, list[int]]:
    """The way without jumps of whole turns, away from the stops and near q_start; or None and the joints that do not fit."""
    out, over = q.copy(), []
    for joint in set(range(6)) - set(wound):
        path = np.unwrap(q[:, joint])
        fits = [2 * np.pi * k for k in range(-3, 4) if path.max() + 2 * np.pi * k <= limit and path.min() + 2 * np.pi * k >= -limit]
        if not fits:
            over.append(joint)
            continue
        ways = path + np.array(fits)[:, None]
        dear = np.abs(ways[:, 0] - q_start[joint]) + _cramped(limit - np.abs(ways).max(axis=1))
        out[:, joint] = ways[dear.argmin()]
    return (None, over) if over else (out, [])


def _smoothed(
    rungs: Rungs,
    q: Float[ndarray, "w 6"],
    roll: Float[ndarray, "w"],
    branch: int,
    arm: Arm,
    limit: float,
    blocked: Blocked | None,
) -> tuple[Float[ndarray, "w 6"], Float[ndarray, "w"]]:
    """The way with its steps of rotation about the wire smoothed as far as it stays clear, solved again in the same branch."""
    if np.ptp(roll) == 0:
        return q, roll
    X_TF = arm.X_FT.inverse()
    for width in SMOOTHINGS[:-1]:
        soft = gaussian_filter1d(roll, width, mode="nearest")
        out = np.empty_like(q)
        for i in range(len(q)):
            solutions = arm.inverse(Transform("BT", turned(rungs.frames[i], float(soft[i])), rungs.p[i]) @ X_TF)
            mine = np.flatnonzero(branch_of(solutions) == branch) if len(solutions) else []
            if len(mine) == 0:
                break
            out[i] = solutions[mine[0]] + 2 * np.pi * np.round((q[i] - solutions[mine[0]]) / (2 * np.pi))
            strays = np.abs(out[i] - q[i]).max() > STEP or np.abs(out[i]).max() > limit
            if strays or (blocked is not None and blocked(out[i]) is not None):
                break
        else:
            return out, soft
    return q, roll
