"""The arm behind the controller: the simulated UR5, driven one control period at a time."""

from typing import Any

import numpy as np

from weldsim.controller.profile import Profile
from weldsim.execution.config import SimulationConfig
from weldsim.execution.simulated import SimulatedRobot
from weldsim.kinematics import JOINT_NAMES


class Arm:
    """Joints that follow a reference, and what they report.

    Attributes:
        q, qd: joint angles [rad] and speeds [rad/s] as measured.
        torque: joint torques [Nm].
    """

    def __init__(self, model: Any, q: list[float], profile: Profile) -> None:
        """Args: model of a world with the arm, a MuJoCo MjModel; q [rad], where it rests."""
        self._robot = SimulatedRobot(model, np.array(q), SimulationConfig(period=profile.period))
        self._robot.connect()
        joints = [self._robot.model.joint(name) for name in JOINT_NAMES]
        self._qpos = np.array([joint.qposadr[0] for joint in joints])
        self._dof = np.array([joint.dofadr[0] for joint in joints])
        self._read()

    def advance(self, q: list[float], qd: list[float]) -> None:
        """One control period, to pass q [rad] at qd [rad/s] when it ends."""
        self._robot.servo(np.array(q), np.array(qd))
        self._read()

    def collisions(self) -> list[str]:
        """What the arm has begun to touch since the last call."""
        return [event.text for event in self._robot.events()]

    def _read(self) -> None:
        data = self._robot.data
        self.q: list[float] = data.qpos[self._qpos].tolist()
        self.qd: list[float] = data.qvel[self._dof].tolist()
        self.torque: list[float] = data.qfrc_actuator[self._dof].tolist()
