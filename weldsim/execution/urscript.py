"""Planned welds as URScript: TCP, air moves, lead-in, the weld streamed at the controller's own period, arc output, lead-out.

The weld is a stream of servoj targets and not a chain of movep: what a controller makes of blends is its own affair, the
stream is the checked motion itself. Its joint angles are those of the arm that was planned for: on a calibrated arm those of a
nominal one put the torch some millimetres off. Approach and lead-out are straight lines (movel), air moves straight in the
joints (movej).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.arm import UR5, Arm
from weldsim.records import JointTrajectory, Segment

LOOKAHEAD, GAIN = 0.03, 300  # [s] the least a controller takes, and its own default
HOLD = 0.2  # [s] that the last target is repeated, until the arm has caught up with it
NAME = "weldsim_job"
FIRST_SPEED = 0.2  # [rad/s] of the leading joint, to where the program starts: the torch stays below 0.25 m/s however far it is
REST, STAYED = 1e-6, 1e-6  # [rad/s] below which the arm is at rest, [rad] by which it has not moved
NEAR = 0.01  # [rad] of each joint from where the program starts, at most
LEAD_ACCELERATION = 0.5  # [m/s2] of the straight lead-in and lead-out


def script_text(
    *trajectories: JointTrajectory,
    starts: Sequence[Float[ndarray, "6"]] = (),
    title: str = "weldsim",
    arm: Arm = UR5,
    arc_output: int = 0,
    joint_acceleration: float = 1.4,
    lead_speed: float = 0.1,
) -> str:
    """One program for all trajectories, in order; each starts where it starts and ends where it ends.

    It is one `def` without a call, which is what a controller's script ports take; a script file of PolyScope needs the call.

    Args:
        trajectories: as planned and checked, at least one; at rest where their segments meet.
        starts: joint angles [rad] from which a straight joint move to the start has been checked, beside the start itself. With the
            arm anywhere else the program says so on the pendant and halts before it moves.
        title: of the program, in a comment.  arm: whose joint angles they are; its torch's TCP is set.
        arc_output: standard digital output that strikes the arc.
        joint_acceleration: of air moves [rad/s2], which are as fast as planned.  lead_speed: of lead-in and lead-out [m/s].
    """
    tcp = ", ".join(f"{v:.9f}" for v in (*arm.X_FT.p, *arm.X_FT.rotation_vector))
    start = ", ".join(f"{v:.1f}" for v in np.rad2deg(trajectories[0].q[0]))
    lines = [
        f"# {' '.join(title.split())}",
        f"# Checked with the arm starting at {start} deg (base to wrist 3):",
        "# with the arm anywhere else it does not move, unless its way there has been checked too.",
        f"# Send it to a script port as it is. In a script file of PolyScope, add the line {NAME}() at its end.",
        f"def {NAME}():",
        *_guard(start, (trajectories[0].q[0], *starts)),
        f"  set_tcp(p[{tcp}])",
        f"  set_standard_digital_out({arc_output}, False)",
    ]
    for trajectory in trajectories:
        lines.append(f"  movej({_joints(trajectory.q[0])}, a={joint_acceleration:g}, v={FIRST_SPEED:g})")
        names = np.array([str(segment) for segment in trajectory.segments])
        edges = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), len(names)]
        for first, last in pairwise(edges):
            # A segment begins at rest where the one before it ended.
            rows = slice(max(0, first - 1), last)
            if names[first] == Segment.AIR:
                lines += [
                    f"  movej({_joints(corner)}, a={joint_acceleration:g}, v={speed:.6f})"
                    for corner, speed in _swings(trajectory, rows)
                ]
            elif names[first] == Segment.WELD:
                lines += _weld(trajectory, rows, arc_output)
            else:
                X_BT = arm.torch_pose(trajectory.q[last - 1])
                pose = ", ".join(f"{v:.9f}" for v in (*X_BT.p, *X_BT.rotation_vector))
                lines.append(f"  movel(p[{pose}], a={LEAD_ACCELERATION:g}, v={lead_speed:g})")
    return "\n".join([*lines, "end", ""])


def _guard(start: str, places: tuple[Float[ndarray, "6"], ...]) -> list[str]:
    """Lines that halt the program before it moves, unless every joint is within NEAR of one of the places [rad]."""
    lines = [
        "  def stands_at(q, there):",
        "    local i = 0",
        "    while i < 6:",
        f"      if norm(q[i] - there[i]) > {NEAR:g}:",
        "        return False",
        "      end",
        "      i = i + 1",
        "    end",
        "    return True",
        "  end",
        "  q_now = get_actual_joint_positions()",
        "  ready = False",
    ]
    for place in places:
        lines.append(f"  ready = ready or stands_at(q_now, {_joints(place)})")
    said = f"The arm is not where this program starts. Move its joints to {start} deg, then play it again."
    return [*lines, "  if not ready:", f'    popup("{said}", title="weldsim", error=True)', "    halt", "  end"]


def _swings(trajectory: JointTrajectory, rows: slice) -> list[tuple[Float[ndarray, "6"], float]]:
    """Where an air move comes to rest, but for its beginning, and the leading joint's greatest speed on the way there [rad/s]."""
    q, qd = trajectory.q[rows], np.abs(trajectory.qd[rows]).max(axis=1)
    out, last = [], 0
    for i in np.flatnonzero(qd < REST):
        if i > 0 and np.abs(q[i] - q[last]).max() > STAYED:
            out.append((q[i], float(qd[last : i + 1].max())))
            last = int(i)
    return out or [(q[-1], FIRST_SPEED)]


def _weld(trajectory: JointTrajectory, rows: slice, arc_output: int) -> list[str]:
    """The stream of targets; the arc is switched as the trajectory has it, as late as the arm follows its targets."""
    period = float(trajectory.t[1] - trajectory.t[0])
    tail = f"t={period:g}, lookahead_time={LOOKAHEAD:g}, gain={GAIN})"
    hold, lag = int(np.ceil(HOLD / period)), int(np.ceil(LOOKAHEAD / period))
    q, arc = trajectory.q[rows], trajectory.arc_on[rows]
    targets = np.concatenate([q, np.repeat(q[-1:], hold, axis=0)])
    burning = np.concatenate([np.zeros(lag, bool), arc, np.zeros(hold - lag, bool)])
    lines, was = [], False
    for target, now in zip(targets, burning, strict=True):
        if bool(now) != was:
            was = bool(now)
            lines.append(f"  set_standard_digital_out({arc_output}, {was})")
        lines.append(f"  servoj({_joints(target)}, {tail}")
    # Nothing but to be sure: whatever the stream was, the arc is off before the torch leaves.
    return [*lines, f"  set_standard_digital_out({arc_output}, False)", "  stopj(2.0)"]


def _joints(q: Float[ndarray, "6"]) -> str:
    return "[" + ", ".join(f"{v:.9f}" for v in q) + "]"
