"""What the controller reports after one control period: the source of every RTDE output."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.execution.ur_modes import RobotMode, RuntimeState, safety_bits
from weldsim.kinematics import link_frames

if TYPE_CHECKING:
    from weldsim.controller.machine import Machine

JOINT_POWER_OFF = 239
JOINT_MODES = {RobotMode.RUNNING: 253, RobotMode.BACKDRIVE: 238, RobotMode.IDLE: 255, RobotMode.POWER_ON: 255}  # UR RTDE guide
BUS_VOLTAGE, IDLE_CURRENT = 48.0, 0.5  # [V], [A]
STANDARD_GRAVITY = 9.80665  # [m/s2]
Frames = Float[ndarray, "6 4 4"]
TORQUE_CONSTANT = (12.0, 12.0, 12.0, 9.0, 9.0, 9.0)  # [Nm/A] order of magnitude, behind the gear; no published figure


class Snapshot:
    """State at one time; what has to be computed is computed when first asked for.

    Attributes:
        t: time since power-on [s].  busy: time the last period took to compute [s].
        q, qd: measured [rad, rad/s].  q_target, qd_target, qdd_target: the reference.  torque [Nm].
        io: registers and signals.  tcp_offset: active TCP.  payload [kg], payload_cog [m], payload_inertia [kg m2].
        robot_mode, safety_mode, runtime_state, status_bits, safety_bits: as the RTDE guide numbers them.
        joint_mode: of every joint.  voltage: of arm and joints [V].  robot_current: of the arm [A].
        speed_scaling: what the controller itself slows its moves down by; times the slider it is the share of the programmed speed.
    """

    def __init__(self, machine: "Machine") -> None:
        arm, reference, tool = machine.arm, machine.reference, machine.tool
        self.t, self.busy, self.io = machine.t, machine.busy, machine.io
        running = machine.robot_mode is RobotMode.RUNNING
        self.q, self.qd = arm.q, arm.qd
        self.torque = arm.torque if running else [0.0] * 6  # otherwise the brakes hold the arm
        self.q_target, self.qd_target, self.qdd_target = reference.q, reference.qd, reference.qdd
        self._tcp, self._kinematics = tool.tcp_matrix, machine.kinematics
        self.tcp_offset, self.payload = tool.tcp, tool.payload
        self.payload_cog, self.payload_inertia = tool.cog, tool.inertia
        self.robot_mode, self.safety_mode = int(machine.robot_mode), int(machine.safety_mode)
        self.runtime_state, self.safety_bits = int(machine.runtime), safety_bits(machine.safety_mode)
        playing = machine.runtime is RuntimeState.PLAYING
        powered = machine.robot_mode in (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.RUNNING)
        self.status_bits = int(powered) | int(playing) << 1 | 1 << 3
        self.joint_mode = JOINT_MODES.get(machine.robot_mode, JOINT_POWER_OFF)
        self.voltage, self.robot_current = (BUS_VOLTAGE, IDLE_CURRENT) if powered else (0.0, 0.0)
        self.speed_scaling = machine.limiter if machine.can_move else 0.0

    @cached_property
    def current(self) -> list[float]:
        return [torque / constant for torque, constant in zip(self.torque, TORQUE_CONSTANT, strict=True)]

    @cached_property
    def tcp_pose(self) -> list[float]:
        return self._kinematics.tcp_pose(self.q, self._tcp)

    @cached_property
    def tcp_pose_target(self) -> list[float]:
        return self._kinematics.tcp_pose(self.q_target, self._tcp)

    @cached_property
    def tcp_speed(self) -> list[float]:
        return (self._kinematics.jacobian(self.q, self._tcp) @ self.qd).tolist() if any(self.qd) else [0.0] * 6

    @cached_property
    def tcp_speed_target(self) -> list[float]:
        J = self._kinematics.jacobian(self.q_target, self._tcp)
        return (J @ self.qd_target).tolist() if any(self.qd_target) else [0.0] * 6

    @cached_property
    def elbow(self) -> list[float]:
        return self._frames[2, :3, 3].tolist()

    @cached_property
    def elbow_speed(self) -> list[float]:
        """Velocity of the elbow [m/s] in the base."""
        elbow = self._frames[2, :3, 3]
        # Only the two joints before it move it; every joint turns about its frame's z.
        before = self._frames[:2]
        return (self.qd[:2] @ np.cross(before[:, :3, 2], elbow - before[:, :3, 3])).tolist()

    @cached_property
    def tool_acceleration(self) -> list[float]:
        """What an accelerometer in the flange feels of gravity [m/s2]; what it would feel of the motion is left out."""
        return (STANDARD_GRAVITY * self._frames[5, 2, :3]).tolist()

    @cached_property
    def _frames(self) -> Frames:
        return link_frames(np.array(self.q))
