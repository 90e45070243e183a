"""A joint trajectory at another pace or period, or from a start that is a little off: as smooth as it was planned."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ExecutionError
from weldsim.quantity import Second
from weldsim.records import JointTrajectory

SAME_PERIOD = 1e-9  # [s]
LEAST_SCALE = 1e-3  # a job of a minute would take most of a day


def at_period(trajectory: JointTrajectory, period: Second) -> JointTrajectory:
    """The trajectory resampled to a robot's period, by quintics through its angles, speeds and accelerations; itself if it
    fits already."""
    t = trajectory.t
    if len(t) < 2 or np.abs(np.diff(t) - period).max() < SAME_PERIOD:
        return trajectory
    length = float(t[-1] - t[0])
    at = period * np.arange(int(np.ceil(length / period - SAME_PERIOD)) + 1)
    inside = np.minimum(at, length) + t[0]
    q, qd, qdd = quintic(t, trajectory.q, trajectory.qd, trajectory.qdd, inside)
    # A sample belongs to the move that is under way, as in the trajectory itself: rounded up to the next one.
    label = np.clip(np.searchsorted(t, inside - SAME_PERIOD), 0, len(t) - 1)
    return JointTrajectory(
        t=at,
        q=q,
        qd=qd,
        qdd=qdd,
        s=np.interp(inside, t, trajectory.s),
        arc_on=trajectory.arc_on[label],
        segments=tuple(trajectory.segments[i] for i in label),
        joint_names=trajectory.joint_names,
    )


def slowed(trajectory: JointTrajectory, scale: float) -> JointTrajectory:
    """The same motion at `scale` times its pace, a share of 1: time is stretched, speeds, accelerations and jerks fall.

    Raises:
        ExecutionError: a scale outside LEAST_SCALE to 1: no motion is made faster than it was checked.
    """
    if not LEAST_SCALE <= scale <= 1.0:
        raise ExecutionError(
            f"speed scale {scale:g}: {LEAST_SCALE:g} to 1 is possible", rule="speed_scale", value=scale, limit=(LEAST_SCALE, 1.0)
        )
    if scale == 1.0:
        return trajectory
    return replace(trajectory, t=trajectory.t / scale, qd=trajectory.qd * scale, qdd=trajectory.qdd * scale**2)


def started_at(trajectory: JointTrajectory, q: Float[ndarray, "6"], blend: Second) -> JointTrajectory:
    """The trajectory begun from where the arm stands [rad]: its offset dies away on a quintic within `blend`.

    The arm is never told to jump, however small the jump. The trajectory must begin in the air, for `blend` at least, for
    what is welded to stay as it was planned.
    """
    offset = q - trajectory.q[0]
    if not offset.any():
        return trajectory
    T = min(blend, float(trajectory.t[-1] - trajectory.t[0]))
    u = np.clip((trajectory.t - trajectory.t[0]) / T, 0.0, 1.0)
    left = 1 - u**3 * (10 - 15 * u + 6 * u**2)
    rate, bend = -30 * u**2 * (1 - u) ** 2 / T, -60 * u * (1 - u) * (1 - 2 * u) / T**2
    return replace(
        trajectory,
        q=trajectory.q + left[:, None] * offset,
        qd=trajectory.qd + rate[:, None] * offset,
        qdd=trajectory.qdd + bend[:, None] * offset,
    )


def quintic(
    t: Float[ndarray, "k"], q: Float[ndarray, "k 6"], qd: Float[ndarray, "k 6"], qdd: Float[ndarray, "k 6"], at: Float[ndarray, "m"]
) -> tuple[Float[ndarray, "m 6"], Float[ndarray, "m 6"], Float[ndarray, "m 6"]]:
    """Angles, speeds and accelerations at times `at` [s], by the quintic between each two samples that has all three of both."""
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    h = (t[i + 1] - t[i])[:, None]
    u = (at - t[i])[:, None] / h
    c1, c2 = qd[i] * h, qdd[i] * h**2 / 2
    d, dv, da = q[i + 1] - q[i] - c1 - c2, qd[i + 1] * h - c1 - 2 * c2, qdd[i + 1] * h**2 - 2 * c2
    c3, c4, c5 = 10 * d - 4 * dv + da / 2, -15 * d + 7 * dv - da, 6 * d - 3 * dv + da / 2
    return (
        q[i] + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5)))),
        (c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h,
        (2 * c2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))) / h**2,
    )
