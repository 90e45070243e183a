"""When: jerk-limited profiles by ruckig for air moves and for the tip's arc length, sampled at the robot's period.

`intermediate_positions` is never set: the free ruckig would send them to a remote service.
"""

from dataclasses import dataclass

import numpy as np
import ruckig
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.errors import MotionError
from weldsim.motion.config import MotionConfig
from weldsim.motion.follow import JointPath
from weldsim.motion.rail import Rail
from weldsim.records import Segment

BLOCK = 0.00125  # [m] a weld slows down over whole blocks of this length
RAMPING, BENDING, TWISTING = 0.35, 0.20, 0.45  # shares of a joint's jerk: of ramps, of ramps on bends, of changing bends
LOOK = 0.01  # [rad] of the leading joint between looks at the tip's speed in the air
CHORD = 1.001  # the tip's way is longer than chords over so small a turn by less
HEADROOM = 0.97  # of a joint limit, so that the ramps between blocks stay inside it


@dataclass(frozen=True, eq=False, kw_only=True)
class Move:
    """One motion from rest to rest, sampled from its first instant (t = 0) every period; the last sample is at rest.

    Attributes:
        segment: what it is.  q, qd, qdd: (k, 6).  s: (k,) [m].  speed: (k,) tip speed along the rail [m/s], 0 in the air.
        slowest: least ratio of allowed to asked tip speed, 1 where the joints' limits never bite.  slowest_at: where [m].
        ramp: length in which the tip reaches its speed at either end [m].
    """

    segment: Segment
    q: Float[ndarray, "k 6"]
    qd: Float[ndarray, "k 6"]
    qdd: Float[ndarray, "k 6"]
    s: Float[ndarray, "k"]
    speed: Float[ndarray, "k"]
    slowest: float = 1.0
    slowest_at: float = 0.0
    ramp: float = 0.0


def _sample(trajectory: ruckig.Trajectory, start: float, period: float, n: int) -> ndarray:
    """Position, speed and acceleration (n, 3, dofs) every period from `start`, held at the end."""
    times = np.minimum(start + period * np.arange(n), trajectory.duration)
    return np.array([trajectory.at_time(float(t))[:3] for t in times])


def _solve(otg: ruckig.Ruckig, request: ruckig.InputParameter, dofs: int, what: str) -> ruckig.Trajectory:
    trajectory = ruckig.Trajectory(dofs)
    try:
        result = otg.calculate(request, trajectory)
    except (ruckig.RuckigError, ValueError) as error:  # a result code that its Python enum does not know is a ValueError
        raise MotionError(f"{what}: no jerk-limited profile; check the limits in the motion config", result=str(error)) from error
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise MotionError(f"{what}: no jerk-limited profile ({result}); check the limits in the motion config", result=str(result))
    return trajectory


def air_move(q0: Float[ndarray, "6"], q1: Float[ndarray, "6"], s: float, config: MotionConfig, arm: Arm = UR5) -> Move:
    """The quickest straight joint move from q0 to q1 [rad], all joints arriving together; `s` is what it is labelled with.

    The arm's torch tip keeps to `config.air_speed` where it moves furthest for each joint's radian.
    """
    request = ruckig.InputParameter(6)
    request.current_position, request.target_position = list(map(float, q0)), list(map(float, q1))
    request.max_velocity = [min(config.joint_speed, config.joint_speed_limit, _joint_speed(q0, q1, arm, config))] * 6
    request.max_acceleration = [min(config.joint_acceleration, config.joint_acceleration_limit)] * 6
    request.max_jerk = [min(config.joint_jerk, config.joint_jerk_limit)] * 6
    request.synchronization = ruckig.Synchronization.Phase
    trajectory = _solve(ruckig.Ruckig(6), request, 6, "air move")
    n = int(np.ceil(trajectory.duration / config.period - 1e-9)) + 1
    q, qd, qdd = np.moveaxis(_sample(trajectory, 0.0, config.period, n), 1, 0)
    # The last sample, and past the end, ruckig's speed and acceleration are zero only to rounding.
    qd[-1], qdd[-1] = 0.0, 0.0
    return Move(segment=Segment.AIR, q=q, qd=qd, qdd=qdd, s=np.full(n, s), speed=np.zeros(n))


def _joint_speed(q0: Float[ndarray, "6"], q1: Float[ndarray, "6"], arm: Arm, config: MotionConfig) -> float:
    """Speed of the leading joint [rad/s] at which the tip is nowhere faster than `config.air_speed` on the straight way."""
    furthest = float(np.abs(q1 - q0).max())
    u = np.linspace(0.0, 1.0, max(2, int(np.ceil(furthest / LOOK)) + 1))
    p = arm.torch_pose(q0 + u[:, None] * (q1 - q0)).p
    chord = float(np.linalg.norm(np.diff(p, axis=0), axis=1).max()) * (len(u) - 1)  # [m] a whole way at the greatest rate
    return config.air_speed * furthest / max(chord * CHORD, 1e-9)


@dataclass(frozen=True, kw_only=True)
class _TipLimits:
    """What the tip may do along one piece: acceleration [m/s2], jerk [m/s3]."""

    acceleration: float
    jerk: float


def piece_move(rail: Rail, path: JointPath, config: MotionConfig) -> Move:
    """The tip along one piece at its asked speed, slower where a joint limit asks for it, at rest at both ends."""
    start, end = float(path.spline.x[0]), float(path.spline.x[-1])
    everywhere = np.linspace(start, end, 9 * max(2, round((end - start) / BLOCK)))
    # Half the joints' acceleration is for ramps of the tip's speed, the rest for bends of the joint path.
    ramp = 0.5 * HEADROOM * config.joint_acceleration_limit / max(float(np.abs(path.spline(everywhere, 1)).max()), 1e-9)
    share = min(1.0, ramp / config.tip_acceleration)
    # A third of the joints' jerk likewise; the rest is for bends, and for ramps on bends.
    soft = RAMPING * HEADROOM * config.joint_jerk_limit / max(float(np.abs(path.spline(everywhere, 1)).max()), 1e-9)
    tip = _TipLimits(acceleration=share * config.tip_acceleration, jerk=min(share * config.tip_jerk, soft))
    edges, asked, steady, ramping = _speed_limits(rail, path, tip, config)
    limit = _allowed(edges, steady, ramping, tip)
    s, ds, dds = _arc_profile(edges, limit, tip, config.period).T
    q1, q2 = path.spline(s, 1), path.spline(s, 2)
    return Move(
        segment=path.segment,
        q=path.spline(s),
        qd=q1 * ds[:, None],
        qdd=q2 * (ds**2)[:, None] + q1 * dds[:, None],
        s=s,
        speed=ds,
        slowest=float((limit / asked).min()),
        slowest_at=float(edges[(limit / asked).argmin()]),
        ramp=min((end - start) / 2, max(_ramp(0.0, float(v), tip) for v in (limit[0], limit[-1]))),
    )


def _speed_limits(
    rail: Rail, path: JointPath, tip: _TipLimits, config: MotionConfig
) -> tuple[Float[ndarray, "b_plus_1"], Float[ndarray, "b"], Float[ndarray, "b"], Float[ndarray, "b"]]:
    """Edges of blocks along the piece [m]; in each the speed asked for, and at most so much of it as the joints allow where the
    tip keeps its speed and where it changes it [m/s]."""
    start, end = float(path.spline.x[0]), float(path.spline.x[-1])
    inside = (rail.s > start + 1e-6) & (rail.s < end - 1e-6)
    changes = rail.s[inside][np.diff(rail.speed[inside], prepend=rail.speed[inside][:1]) != 0]
    edges = np.unique(np.concatenate([np.linspace(start, end, max(1, round((end - start) / BLOCK)) + 1), changes]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-6])]
    edges[-1] = end
    i = np.clip(np.searchsorted(rail.s, (edges[:-1] + edges[1:]) / 2, side="right") - 1, 0, len(rail.s) - 2)
    # Inside the weld the slower neighbour counts; a lead has its own speed at its far end alone.
    pick = np.minimum if path.segment == Segment.WELD else np.maximum
    asked = pick(rail.speed[i], rail.speed[i + 1])
    rate, bend, twist = (np.maximum(_greatest(path, edges, order), 1e-9) for order in (1, 2, 3))
    speed, acceleration, jerk = (
        HEADROOM * limit for limit in (config.joint_speed_limit, config.joint_acceleration_limit, config.joint_jerk_limit)
    )
    steady = np.minimum.reduce([asked, speed / rate, np.sqrt(acceleration / bend), np.cbrt(jerk / twist)])
    # The third derivative of q(s(t)) has three terms, q' by jerk, 3 q'' by speed and acceleration, q''' by the cube of speed:
    # each with its share of the joint's jerk.
    bends = np.sqrt((acceleration - rate * tip.acceleration) / bend)
    ramping = np.minimum.reduce(
        [steady, bends, np.cbrt(TWISTING * jerk / twist), BENDING * jerk / np.maximum(3 * bend * tip.acceleration, 1e-9)]
    )
    return edges, asked, steady, ramping


def _allowed(
    edges: Float[ndarray, "b_plus_1"], steady: Float[ndarray, "b"], ramping: Float[ndarray, "b"], tip: _TipLimits
) -> Float[ndarray, "b"]:
    """The greatest speed in each block [m/s]: `steady` where the tip passes it without a change of speed, else `ramping`.

    A block beside a slower one is passed at that one's speed where that is faster than its own `ramping`.
    """
    limit = steady.copy()
    limit[[0, -1]] = ramping[[0, -1]]
    while True:
        limit = _levelled(limit, ramping)
        wrong = _changing(edges, limit, tip) & (limit > ramping)
        if not wrong.any():
            return limit
        limit[wrong] = ramping[wrong]


def _levelled(limit: Float[ndarray, "b"], ramping: Float[ndarray, "b"]) -> Float[ndarray, "b"]:
    """The limits with those above `ramping` lowered to what the blocks beside them have, but not below it."""
    while True:
        beside = np.minimum(np.append(limit[1:], np.inf), np.append(np.inf, limit[:-1]))
        lowered = np.maximum(np.minimum(limit, ramping), np.minimum(limit, beside))
        if (lowered == limit).all():
            return limit
        limit = lowered


def _changing(edges: Float[ndarray, "b_plus_1"], limit: Float[ndarray, "b"], tip: _TipLimits) -> Bool[ndarray, "b"]:
    """In which blocks the tip changes its speed."""
    out = np.zeros(len(limit), bool)
    for a, b, v0, v1, cap in _runs(edges, limit, tip):
        up, down = a + _ramp(v0, cap, tip), b - _ramp(cap, v1, tip)
        mine = (edges[:-1] < b) & (edges[1:] > a)
        out |= mine & ((up > down) | (edges[:-1] < up) | (edges[1:] > down))
    return out


def _greatest(path: JointPath, edges: Float[ndarray, "b_plus_1"], order: int) -> Float[ndarray, "b"]:
    """Greatest size of any joint's derivative of that order in each block.

    The spline is cubic between its knots, which lie closer together where the path bends: its third derivative is constant
    there, its second greatest at one of them. Samples that are even along the block would miss what lies between.
    """
    knots = path.spline.x
    u = np.unique(
        np.concatenate(
            [knots, (knots[1:] + knots[:-1]) / 2, edges, *((edges[1:] * k + edges[:-1] * (9 - k)) / 9 for k in range(1, 9))]
        )
    )
    u = u[(u >= edges[0]) & (u <= edges[-1])]
    size = np.abs(path.spline(u, order)).max(axis=1)
    if order == 3:  # at a knot it is that of the interval that begins there: the one that ends there counts too
        size = np.maximum(size, np.concatenate([size[:1], size[:-1]]))
    first = np.searchsorted(u, edges[:-1])
    return np.maximum(np.maximum.reduceat(size, first), size[np.searchsorted(u, edges[1:])])


def _arc_profile(
    edges: Float[ndarray, "b_plus_1"], limit: Float[ndarray, "b"], tip: _TipLimits, period: float
) -> Float[ndarray, "k 3"]:
    """Arc length, speed and acceleration of the tip (k, 3) every period: at the limit wherever the ramps allow."""
    rows, clock = [], 0.0
    for a, b, v0, v1, cap in _runs(edges, limit, tip):
        request = ruckig.InputParameter(1)
        request.current_position, request.target_position = [float(a)], [float(b)]
        request.current_velocity, request.target_velocity = [float(v0)], [float(v1)]
        request.max_velocity = [float(max(cap, v0, v1))]
        request.max_acceleration, request.max_jerk = [tip.acceleration], [tip.jerk]
        trajectory = _solve(ruckig.Ruckig(1), request, 1, f"arc length {1e3 * a:.1f} to {1e3 * b:.1f} mm")
        n = max(0, int(np.ceil((trajectory.duration - clock) / period - 1e-9)))
        if n:
            rows.append(_sample(trajectory, clock, period, n)[..., 0])
        clock += n * period - trajectory.duration
    rows.append(np.array([[edges[-1], 0.0, 0.0]]))
    profile = np.concatenate(rows)
    profile[:, 0] = np.clip(profile[:, 0], edges[0], edges[-1])
    return profile


def _runs(edges: Float[ndarray, "b_plus_1"], limit: Float[ndarray, "b"], tip: _TipLimits) -> Float[ndarray, "r 5"]:
    """Of each run of blocks with the same limit: where it starts and ends [m], the speed at both and the limit [m/s]."""
    new = np.concatenate([[True], np.abs(np.diff(limit)) > 1e-9])
    edges, limit = np.append(edges[:-1][new], edges[-1]), limit[new]
    between = _reachable(edges, np.concatenate([[0.0], np.minimum(limit[:-1], limit[1:]), [0.0]]), tip)
    return np.stack([edges[:-1], edges[1:], between[:-1], between[1:], limit], axis=1)


def _reachable(edges: Float[ndarray, "b_plus_1"], speed: Float[ndarray, "b_plus_1"], tip: _TipLimits) -> Float[ndarray, "b_plus_1"]:
    """Edge speeds lowered until each block is long enough to change from one to the next within acceleration and jerk."""
    speed = speed.copy()
    for order in (range(len(edges) - 1), range(len(edges) - 2, -1, -1)):
        for k in order:
            low, high = sorted((k, k + 1), key=lambda e: speed[e])
            length, best = edges[k + 1] - edges[k], speed[high]
            while _ramp(speed[low], best, tip) > length and best > speed[low]:
                best = max(speed[low], best - 0.05 * (speed[high] - speed[low]) - 1e-9)
            speed[high] = best
    return speed


def _ramp(v0: float, v1: float, tip: _TipLimits) -> float:
    """Length [m] needed to change speed from v0 to v1 with both accelerations zero at the ends."""
    dv, a, j = abs(v1 - v0), tip.acceleration, tip.jerk
    time = 2 * np.sqrt(dv / j) if dv <= a * a / j else dv / a + a / j
    return float((v0 + v1) / 2 * time)
