"""What the controller knows of its arm: forward and inverse kinematics of the flange and of the active tool centre point.

Joint angles and poses are plain lists, as programs and RTDE have them.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.kinematics import DH, JOINT_LIMIT, dh_frames, frames_jacobian, inverse_of_many, joints_at
from weldsim.urscript.poses import Matrix, inverse_matrix, matrix_of, pose_of


class Kinematics:
    """Of one arm.

    Attributes:
        dh: (6, 4) theta offset [rad], a [m], d [m], alpha [rad] of each joint, factory calibration included.
    """

    def __init__(self, dh: Float[ndarray, "6 4"] = DH) -> None:
        self.dh = dh
        self._nominal = bool((dh == DH).all())
        inverse_of_many(np.eye(4)[None])  # its library is loaded now, not in a control period

    def tcp_matrix(self, q: Sequence[float], tcp: Matrix) -> Matrix:
        """X_BT for joint angles q [rad] and X_FT = tcp."""
        return dh_frames(self.dh, np.asarray(q, float))[6] @ tcp

    def tcp_pose(self, q: Sequence[float], tcp: Matrix) -> list[float]:
        """Pose of the TCP in the base for joint angles q [rad]."""
        return pose_of(self.tcp_matrix(q, tcp))

    def joints_near(self, matrix: Matrix, tcp: Matrix, near: Sequence[float]) -> list[float] | None:
        """Joint angles [rad] that put the TCP at X_BT = matrix, the solution nearest to `near` within limits; None without any."""
        flange = matrix @ inverse_matrix(tcp)
        q, _ = inverse_of_many(flange[None])
        if len(q) == 0 or not np.isfinite(q).all():
            return None
        start = np.asarray(near, float)
        turned = q + 2 * np.pi * np.round((start - q) / (2 * np.pi))
        turned = np.where(np.abs(turned) > JOINT_LIMIT, q, turned)
        nearest = turned[np.abs(turned - start).max(axis=1).argmin()].tolist()
        if self._nominal:
            return nearest
        found = joints_at(self.dh, flange[None], np.array([nearest]))[0]
        return found.tolist() if np.isfinite(found).all() else None

    def pose_joints(self, pose: Sequence[float], tcp: Matrix, near: Sequence[float]) -> list[float] | None:
        """`joints_near` for a pose."""
        return self.joints_near(matrix_of(pose), tcp, near)

    def jacobian(self, q: Sequence[float], tcp: Matrix) -> Float[ndarray, "6 6"]:
        """Geometric Jacobian of the TCP in the base: rows vx vy vz [m] and wx wy wz [rad], one column a joint."""
        frames = dh_frames(self.dh, np.asarray(q, float))
        return frames_jacobian(frames, (frames[6] @ tcp)[:3, 3])
