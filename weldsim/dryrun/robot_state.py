"""What a robot program knows of its robot while it is only read: the TCP, and where the arm is after the motions so far."""

from typing import Any

import numpy as np

from weldsim.dryrun.unknown import NoSolution
from weldsim.errors import UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import flange_pose, inverse, inverse_near
from weldsim.urscript.check import six
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import Pose

INSIDE = ("to_joints", "to_pose", "to_flange", "tcp_pose")  # of RobotState's methods: no functions of URScript


class RobotState:
    """Functions of a program that ask where the arm is. Where it stands before its first motion is known where it was said.

    Attributes:
        mount: X_FT of the TCP in force.
        asked: the first function whose answer came from where the arm stands before its first motion, or "".
    """

    def __init__(self, mount: Transform, q_start: np.ndarray | None = None) -> None:
        self.mount = mount
        self._q = q_start  # [rad] the last joint angles that are known
        self._since: list[Transform] = []  # X_BF of the motions after them
        self._from_start = True  # whether what is known comes from where it stood
        self.asked = ""

    def to_joints(self, q: list[float]) -> None:
        """The arm goes to joint angles [rad]."""
        self._q, self._since, self._from_start = np.array(q), [], False

    def to_pose(self, pose: list[float]) -> Transform:
        """The arm goes to a pose of the TCP; its flange's, X_BF."""
        return self.to_flange(self._flange(pose))

    def to_flange(self, X_BF: Transform) -> Transform:
        """The arm goes to a pose of the flange, which is returned."""
        self._since.append(X_BF)
        return X_BF

    def get_actual_joint_positions(self) -> list[float]:
        return self._joints("get_actual_joint_positions").tolist()

    def get_target_joint_positions(self) -> list[float]:
        return self._joints("get_target_joint_positions").tolist()

    def get_actual_tcp_pose(self) -> Pose:
        return self.tcp_pose("get_actual_tcp_pose")

    def get_target_tcp_pose(self) -> Pose:
        return self.tcp_pose("get_target_tcp_pose")

    def tool_pose(self) -> Pose:
        """As PolyScope writes the tool's feature."""
        return self.tcp_pose("tool_pose")

    def get_actual_tool_flange_pose(self) -> Pose:
        return _pose(self._since[-1] if self._since else flange_pose(self._joints("get_actual_tool_flange_pose")))

    def get_tcp_offset(self) -> Pose:
        return _pose(self.mount)

    def get_forward_kin(self, q: Any = None, tcp: Any = None) -> Pose:
        """The pose of the TCP, or of another one, at joint angles, by default where the arm is."""
        joints = self._joints("get_forward_kin") if q is None else np.array(six(q, "get_forward_kin"))
        return _pose(flange_pose(joints) @ self._mount(tcp))

    def get_inverse_kin(
        self, x: Any, qnear: Any = None, maxPositionError: float = 1e-10, maxOrientationError: float = 1e-10, tcp: Any = None
    ) -> list[float] | NoSolution:
        """Joint angles that put the TCP at x, those nearest to qnear, by default to where the arm is."""
        near = self._joints("get_inverse_kin") if qnear is None else np.array(six(qnear, "get_inverse_kin"))
        X_BF = self._pose_of(six(x, "get_inverse_kin")) @ self._mount(tcp).inverse()
        try:
            return inverse_near(X_BF, near).tolist()
        except UnreachableError as error:
            return NoSolution("get_inverse_kin", X_BF, str(error))

    def get_inverse_kin_has_solution(
        self, x: Any, qnear: Any = None, maxPositionError: float = 1e-10, maxOrientationError: float = 1e-10, tcp: Any = None
    ) -> bool:
        """Whether get_inverse_kin finds joint angles."""
        return len(inverse(self._pose_of(six(x, "get_inverse_kin_has_solution")) @ self._mount(tcp).inverse())) > 0

    def _mount(self, tcp: Any) -> Transform:
        if tcp is None or isinstance(tcp, str):
            return self.mount
        values = six(tcp, "tcp")
        return Transform.from_rotation_vector("FT", np.array(values[3:]), np.array(values[:3]))

    def _pose_of(self, pose: list[float]) -> Transform:
        return Transform.from_rotation_vector("BT", np.array(pose[3:]), np.array(pose[:3]))

    def _flange(self, pose: list[float]) -> Transform:
        return self._pose_of(pose) @ self.mount.inverse()

    def tcp_pose(self, name: str) -> Pose:
        """Where the TCP is by then. Raises ScriptError in the name of whoever asks, where that is not known."""
        X_BF = self._since[-1] if self._since else flange_pose(self._joints(name))
        return _pose(X_BF @ self.mount)

    def _joints(self, name: str) -> np.ndarray:
        """Where the arm is [rad], its poses since reached in the branch it is in."""
        if self._q is None:
            raise ScriptError(f"{name}: where the arm is by then is not known; begin with movej to six joint angles")
        if self._from_start:
            self.asked = self.asked or name
        q = self._q
        for X_BF in self._since:
            if len(inverse(X_BF)):  # out of reach the arm stays where it was, and that motion fails when it is checked
                q = inverse_near(X_BF, q)
        self._q, self._since = q, []
        return q


def _pose(X: Transform) -> Pose:
    return Pose([*X.p.tolist(), *X.rotation_vector.tolist()])
