"""What the controller knows of its arm: forward and inverse kinematics of the flange and of the active tool centre point.

Joint angles and poses are plain lists, as programs and RTDE have them; the figures are those of `weldsim.kinematics`.
"""

from collections.abc import Sequence

import numpy as np
import ur_analytic_ik
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import JOINT_LIMIT, link_frames
from weldsim.urscript.poses import Matrix, inverse_matrix, matrix_of, pose_of

_IK = ur_analytic_ik.ur5.inverse_kinematics  # pyright: ignore[reportAttributeAccessIssue] - compiled, untyped


def tcp_matrix(q: Sequence[float], tcp: Matrix) -> Matrix:
    """X_BT for joint angles q [rad] and X_FT = tcp."""
    return link_frames(np.asarray(q, float))[5] @ tcp


def tcp_pose(q: Sequence[float], tcp: Matrix) -> list[float]:
    """Pose of the TCP in the base for joint angles q [rad]."""
    return pose_of(tcp_matrix(q, tcp))


def joints_near(matrix: Matrix, tcp: Matrix, near: Sequence[float]) -> list[float] | None:
    """Joint angles [rad] that put the TCP at X_BT = matrix, the solution nearest to `near` within limits; None without any."""
    solutions = _IK(matrix @ inverse_matrix(tcp))
    if len(solutions) == 0:
        return None
    q = np.array([np.asarray(solution, float).reshape(6) for solution in solutions])
    if not np.isfinite(q).all():
        return None
    start = np.asarray(near, float)
    turned = q + 2 * np.pi * np.round((start - q) / (2 * np.pi))
    turned = np.where(np.abs(turned) > JOINT_LIMIT, q, turned)
    return turned[np.abs(turned - start).max(axis=1).argmin()].tolist()


def pose_joints(pose: Sequence[float], tcp: Matrix, near: Sequence[float]) -> list[float] | None:
    """`joints_near` for a pose."""
    return joints_near(matrix_of(pose), tcp, near)


def jacobian(q: Sequence[float], tcp: Matrix) -> Float[ndarray, "6 6"]:
    """Geometric Jacobian of the TCP in the base: rows vx vy vz [m] and wx wy wz [rad], one column a joint."""
    frames = link_frames(np.asarray(q, float))
    tip = (frames[5] @ tcp)[:3, 3]
    axes = frames[:, :3, 2]  # every joint turns about its frame's z (modified DH)
    return np.concatenate([np.cross(axes, tip - frames[:, :3, 3]).T, axes.T])
