"""Functions about the arm's kinematics."""

from math import hypot
from typing import Any

import numpy as np

from weldsim.controller.machine import Machine
from weldsim.kinematics import JOINT_LIMIT
from weldsim.urscript.check import is_pose, six
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.poses import Matrix, matrix_of
from weldsim.urscript.values import Pose

REACH = 1.5  # [m] no TCP of this arm is farther from its base


class GeometryFunctions:
    """Forward and inverse kinematics."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def get_forward_kin(self, q: Any = None, tcp: Any = None) -> Pose:
        """The TCP's pose at joint angles q, now by default, with the active TCP by default."""
        joints = self._machine.arm.q if q is None else six(q, "q")
        return Pose(self._machine.kinematics.tcp_pose(joints, self._tcp(tcp)))

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
        near = self._machine.arm.q if near is None else six(near, "qnear")
        return self._machine.kinematics.pose_joints(six(x, "x"), self._tcp(tcp), near)

    def _tcp(self, tcp: Any) -> Matrix:
        return self._machine.tool.tcp_matrix if tcp is None or isinstance(tcp, str) else matrix_of(six(tcp, "tcp"))

    def is_within_safety_limits(self, pose: Any) -> bool:
        """Whether the arm can be at a pose, or at joint angles."""
        values = six(pose, "pose")
        if is_pose(pose):
            return hypot(*values[:3]) < REACH and self._solve(pose, None, None) is not None
        return all(abs(q) <= JOINT_LIMIT for q in values)

    def get_actual_tool_flange_pose(self) -> Pose:
        return Pose(self._machine.kinematics.tcp_pose(self._machine.arm.q, np.eye(4)))
