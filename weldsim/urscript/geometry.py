"""Functions about poses: arithmetic that needs no robot."""

from collections.abc import Sequence
from math import atan2, hypot
from typing import Any

import numpy as np

from weldsim.urscript.check import is_pose, six
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.poses import inverse_matrix, matrix_of, pose_between, pose_of
from weldsim.urscript.values import Pose, number


class PoseFunctions:
    """Poses composed, inverted, compared; rotations in other forms."""

    def pose_trans(self, p_from: Any, p_from_to: Any) -> Pose:
        """p_from composed with p_from_to."""
        return Pose(pose_of(matrix_of(six(p_from, "p_from")) @ matrix_of(six(p_from_to, "p_from_to"))))

    def pose_inv(self, p_from: Any) -> Pose:
        return Pose(pose_of(inverse_matrix(matrix_of(six(p_from, "p_from")))))

    def inv(self, m: Any) -> Any:
        """The inverse of a pose, or of a square matrix."""
        if is_pose(m):
            return self.pose_inv(m)
        try:
            matrix = np.array([[number(item) for item in row] for row in m], float)
            return np.linalg.inv(matrix).tolist()
        except (TypeError, ValueError, np.linalg.LinAlgError):
            raise ScriptError("inv: expected a pose, or a square matrix that has an inverse") from None

    def pose_add(self, p_1: Any, p_2: Any) -> Pose:
        """Positions added, rotations composed: R = R1 R2."""
        return self._combine(six(p_1, "p_1"), six(p_2, "p_2"), 1.0)

    def pose_sub(self, p_to: Any, p_from: Any) -> Pose:
        """Positions subtracted, rotation R = R_to R_from^-1."""
        return self._combine(six(p_to, "p_to"), six(p_from, "p_from"), -1.0)

    def _combine(self, a: list[float], b: list[float], sign: float) -> Pose:
        A, B = matrix_of(a), matrix_of(b)
        turn = np.eye(4)
        turn[:3, :3] = A[:3, :3] @ (B[:3, :3] if sign > 0 else B[:3, :3].T)
        return Pose([*(x + sign * y for x, y in zip(a[:3], b[:3], strict=True)), *pose_of(turn)[3:]])

    def pose_dist(self, p_from: Any, p_to: Any) -> float:
        """Distance [m]."""
        return self.point_dist(p_from, p_to)

    def point_dist(self, p_from: Any, p_to: Any) -> float:
        """Distance [m]."""
        a, b = six(p_from, "p_from"), six(p_to, "p_to")
        return hypot(*(x - y for x, y in zip(a[:3], b[:3], strict=True)))

    def interpolate_pose(self, p_from: Any, p_to: Any, alpha: float) -> Pose:
        """The pose a share alpha of the way."""
        return Pose(pose_between(six(p_from, "p_from"), six(p_to, "p_to"), number(alpha)))

    def rotvec2rpy(self, rotation_vector: Any) -> list[float]:
        """Roll, pitch, yaw [rad] of a rotation vector: R = Rz(yaw) Ry(pitch) Rx(roll)."""
        R = matrix_of([0.0, 0.0, 0.0, *_three(rotation_vector)])
        pitch = atan2(-R[2, 0], hypot(R[2, 1], R[2, 2]))
        if hypot(R[2, 1], R[2, 2]) < 1e-9:  # only the difference of roll and yaw shows: all of it is yaw
            return [0.0, pitch, atan2(-R[0, 1], R[1, 1])]
        return [atan2(R[2, 1], R[2, 2]), pitch, atan2(R[1, 0], R[0, 0])]

    def rpy2rotvec(self, rpy: Any) -> list[float]:
        """The rotation vector of roll, pitch, yaw [rad]."""
        roll, pitch, yaw = _three(rpy)
        turns = [matrix_of([0.0, 0.0, 0.0, *axis]) for axis in ((0.0, 0.0, yaw), (0.0, pitch, 0.0), (roll, 0.0, 0.0))]
        return pose_of(turns[0] @ turns[1] @ turns[2])[3:]

    def norm(self, a: Any) -> float:
        """Length of a list, magnitude of a number."""
        return hypot(*(number(x) for x in a)) if isinstance(a, list) else abs(number(a))

    def normalize(self, v: Any) -> list[float]:
        """A list divided by its length."""
        length = self.norm(v)
        return [x / length if length > 0 else 0.0 for x in v]

    def wrench_trans(self, T_from_to: Any, w_from: Any) -> list[float]:
        """A wrench [N, Nm] expressed at and in another frame."""
        X, w = inverse_matrix(matrix_of(six(T_from_to, "T_from_to"))), six(w_from, "w_from")
        force = X[:3, :3] @ np.array(w[:3])
        return [*force.tolist(), *(X[:3, :3] @ np.array(w[3:]) + np.cross(X[:3, 3], force)).tolist()]


def _three(value: Any) -> Sequence[float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ScriptError("expected three numbers")
    return [float(number(x)) for x in value]
