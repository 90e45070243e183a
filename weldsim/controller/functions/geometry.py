"""Functions about poses and joint angles."""

from collections.abc import Sequence
from math import atan2, hypot
from typing import Any

import numpy as np

from weldsim.controller.functions.check import is_pose, six
from weldsim.controller.kinematics import pose_joints, tcp_matrix, tcp_pose
from weldsim.controller.machine import Machine
from weldsim.controller.poses import Matrix, inverse_matrix, matrix_of, pose_between, pose_of
from weldsim.controller.urscript.errors import ScriptError
from weldsim.controller.urscript.values import Pose, number
from weldsim.kinematics import JOINT_LIMIT

REACH = 1.5  # [m] no TCP of this arm is farther from its base


class GeometryFunctions:
    """Pose arithmetic, forward and inverse kinematics."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def pose_trans(self, p_from: Any, p_from_to: Any) -> Pose:
        """p_from composed with p_from_to."""
        return Pose(pose_of(matrix_of(six(p_from, "p_from")) @ matrix_of(six(p_from_to, "p_from_to"))))

    def pose_inv(self, p_from: Any) -> Pose:
        return Pose(pose_of(inverse_matrix(matrix_of(six(p_from, "p_from")))))

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

    def get_forward_kin(self, q: Any = None, tcp: Any = None) -> Pose:
        """The TCP's pose at joint angles q, now by default, with the active TCP by default."""
        joints = self._machine.arm.q if q is None else six(q, "q")
        return Pose(tcp_pose(joints, self._tcp(tcp)))

    def get_inverse_kin(
        self, x: Any, qnear: Any = None, maxPositionError: float = 1e-10, maxOrientationError: float = 1e-10, tcp: Any = None
    ) -> list[float]:
        """Joint angles that put the TCP at x, the solution nearest to qnear, now by default. ScriptError without any."""
        q = self._solve(x, qnear, tcp)
        if q is None:
            raise ScriptError(f"get_inverse_kin: no joint angles put the TCP at p[{', '.join(f'{v:.4f}' for v in six(x, 'x'))}]")
        return q

    def get_inverse_kin_has_solution(
        self, x: Any, qnear: Any = None, maxPositionError: float = 1e-10, maxOrientationError: float = 1e-10, tcp: Any = None
    ) -> bool:
        """Whether get_inverse_kin would find one."""
        return self._solve(x, qnear, tcp) is not None

    def _solve(self, x: Any, near: Any, tcp: Any) -> list[float] | None:
        return pose_joints(six(x, "x"), self._tcp(tcp), self._machine.arm.q if near is None else six(near, "qnear"))

    def _tcp(self, tcp: Any) -> Matrix:
        return self._machine.tool.tcp_matrix if tcp is None or isinstance(tcp, str) else matrix_of(six(tcp, "tcp"))

    def is_within_safety_limits(self, pose: Any) -> bool:
        """Whether the arm can be at a pose, or at joint angles."""
        values = six(pose, "pose")
        if is_pose(pose):
            return hypot(*values[:3]) < REACH and self._solve(pose, None, None) is not None
        return all(abs(q) <= JOINT_LIMIT for q in values)

    def get_actual_tool_flange_pose(self) -> Pose:
        return Pose(pose_of(tcp_matrix(self._machine.arm.q, np.eye(4))))

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
