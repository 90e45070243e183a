"""A planned weld as URScript: TCP, air moves, lead-in, the weld streamed at the controller's own period, arc output, lead-out.

The weld is a stream of servoj targets and not a chain of movep: what a controller makes of blends is its own affair, the
stream is the checked motion itself. Approach and lead-out are straight lines (movel), air moves straight in the joints (movej).
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.kinematics import torch_pose
from weldsim.mounts import X_FT as NOMINAL_X_FT
from weldsim.records import JointTrajectory, Segment

LOOKAHEAD, GAIN = 0.03, 300  # [s] the least a controller takes, and its own default
HOLD = 0.2  # [s] that the last target is repeated, until the arm has caught up with it
REST = 1e-6  # [rad/s] below which the arm is at rest
LEAD_ACCELERATION = 0.5  # [m/s2] of the straight lead-in and lead-out


def script_text(
    trajectory: JointTrajectory,
    *,
    title: str = "weldsim",
    X_FT: Transform = NOMINAL_X_FT,
    arc_output: int = 0,
    joint_speed: float = 1.05,
    joint_acceleration: float = 1.4,
    lead_speed: float = 0.1,
) -> str:
    """The program, which starts where the trajectory starts and ends where it ends.

    Args:
        trajectory: as planned and checked; at rest where its segments meet.
        title: of the program, in a comment.  X_FT: the TCP that is set.
        arc_output: standard digital output that strikes the arc.
        joint_speed, joint_acceleration: of air moves [rad/s], [rad/s2].  lead_speed: of lead-in and lead-out [m/s].
    """
    q = trajectory.q
    names = np.array([str(segment) for segment in trajectory.segments])
    edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), len(names)]
    tcp = ", ".join(f"{v:.9f}" for v in (*X_FT.p, *X_FT.rotation_vector))
    lines = [
        f"# {' '.join(title.split())}",
        "# The arm must stand free to reach the first target on a straight joint move.",
        "def weldsim_job():",
        f"  set_tcp(p[{tcp}])",
        f"  set_standard_digital_out({arc_output}, False)",
        f"  movej({_joints(q[0])}, a={joint_acceleration:g}, v={joint_speed:g})",
    ]
    for first, last in pairwise(edges):
        # A segment begins at rest where the one before it ended.
        rows = slice(max(0, first - 1), last)
        if names[first] == Segment.AIR:
            lines += [
                f"  movej({_joints(corner)}, a={joint_acceleration:g}, v={joint_speed:g})" for corner in _corners(trajectory, rows)
            ]
        elif names[first] == Segment.WELD:
            lines += _weld(trajectory, rows, arc_output)
        else:
            X_BT = torch_pose(q[last - 1], X_FT)
            pose = ", ".join(f"{v:.9f}" for v in (*X_BT.p, *X_BT.rotation_vector))
            lines.append(f"  movel(p[{pose}], a={LEAD_ACCELERATION:g}, v={lead_speed:g})")
    return "\n".join([*lines, "end", "weldsim_job()", ""])


def _corners(trajectory: JointTrajectory, rows: slice) -> Float[ndarray, "c 6"]:
    """Where an air move comes to rest: the ends of its straight pieces, but for the first."""
    rest = np.abs(trajectory.qd[rows]).max(axis=1) < REST
    q = trajectory.q[rows]
    at = [i for i in np.flatnonzero(rest) if i > 0 and np.abs(q[i] - q[0]).max() > 1e-6]
    kept = [i for k, i in enumerate(at) if k + 1 == len(at) or np.abs(q[at[k + 1]] - q[i]).max() > 1e-6]
    return q[kept] if kept else q[-1:]


def _weld(trajectory: JointTrajectory, rows: slice, arc_output: int) -> list[str]:
    """The stream of targets with the arc switched as the trajectory has it."""
    period = float(trajectory.t[1] - trajectory.t[0])
    tail = f"t={period:g}, lookahead_time={LOOKAHEAD:g}, gain={GAIN})"
    lines, burning = [], False
    for q, arc in zip(trajectory.q[rows], trajectory.arc_on[rows], strict=True):
        if bool(arc) != burning:
            burning = bool(arc)
            lines.append(f"  set_standard_digital_out({arc_output}, {burning})")
        lines.append(f"  servoj({_joints(q)}, {tail}")
    last = f"  servoj({_joints(trajectory.q[rows][-1])}, {tail}"
    lines += [last] * int(np.ceil(HOLD / period))
    lines.append(f"  set_standard_digital_out({arc_output}, False)")
    return [*lines, "  stopj(2.0)"]


def _joints(q: Float[ndarray, "6"]) -> str:
    return "[" + ", ".join(f"{v:.9f}" for v in q) + "]"
