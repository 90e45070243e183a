"""Functions that ask for the robot's state, or tell it what it carries."""

from typing import Any

from weldsim.controller.machine import Machine
from weldsim.urscript.check import six
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import Pose, number

MAX_PAYLOAD = 10.0  # [kg] what a UR5 accepts is less, its newer firmware more; beyond this it is a mistake of units
FORCE_TYPES = (1, 2, 3)  # how the force frame is transformed: to the TCP, not at all, to the TCP's motion


class RobotFunctions:
    """State, TCP and payload. Force control is not modelled: it is accepted, checked, and the arm stays where it is."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine

    def get_actual_joint_positions(self) -> list[float]:
        return list(self._machine.arm.q)

    def get_actual_joint_speeds(self) -> list[float]:
        return list(self._machine.arm.qd)

    def get_target_joint_positions(self) -> list[float]:
        return list(self._machine.reference.q)

    def get_target_joint_speeds(self) -> list[float]:
        return list(self._machine.reference.qd)

    def get_joint_torques(self) -> list[float]:
        return list(self._machine.arm.torque)

    def get_joint_temp(self, j: int) -> float:
        return 30.0

    def get_actual_joint_positions_history(self, steps: int = 0) -> list[float]:
        """Joint angles some periods ago; the oldest kept where that is longer than is kept."""
        history = self._machine.history
        return list(history[max(0, len(history) - 1 - int(number(steps)))])

    def get_actual_tcp_pose(self) -> Pose:
        return Pose(self._machine.kinematics.tcp_pose(self._machine.arm.q, self._machine.tool.tcp_matrix))

    def get_target_tcp_pose(self) -> Pose:
        return Pose(self._machine.kinematics.tcp_pose(self._machine.reference.q, self._machine.tool.tcp_matrix))

    def tool_pose(self) -> Pose:
        """As PolyScope writes the tool's feature."""
        return self.get_target_tcp_pose()

    def get_target_waypoint(self) -> Pose:
        """Where the move that is under way will end; the target pose of now without one."""
        waypoint = self._machine.waypoint
        return self.get_target_tcp_pose() if waypoint is None else Pose(waypoint)

    def get_actual_tcp_speed(self) -> list[float]:
        return list(self._machine.snapshot.tcp_speed)

    def get_target_tcp_speed(self) -> list[float]:
        return self._machine.reference.twist(self._machine.tool.tcp_matrix)

    def get_tcp_force(self) -> list[float]:
        return [0.0] * 6

    def force(self) -> float:
        return 0.0

    def get_tcp_offset(self) -> Pose:
        return Pose(self._machine.tool.tcp)

    def get_controller_temp(self) -> float:
        return 30.0

    def is_steady(self) -> bool:
        """Whether the arm is at rest."""
        return max(abs(speed) for speed in self._machine.arm.qd) < self._machine.config.standstill

    def set_tcp(self, pose: Any, tcp_name: str = "") -> None:
        """The active TCP, X_FT."""
        self._machine.set_tcp(six(pose, "set_tcp pose"))

    def set_payload(self, m: float, cog: Any = None) -> None:
        """Mass [kg] and its centre in the flange [m]; the centre is the TCP where it is not given."""
        tool = self._machine.tool
        tool.payload = self._mass(m)
        tool.cog = list(tool.tcp[:3]) if cog is None else [float(number(x)) for x in cog]

    def set_payload_mass(self, m: float) -> None:
        self._machine.tool.payload = self._mass(m)

    def set_payload_cog(self, cog: Any) -> None:
        self._machine.tool.cog = [float(number(x)) for x in cog]

    def set_target_payload(self, m: float, cog: Any, inertia: Any = None, transition_time: float = 0) -> None:
        """Mass [kg], its centre [m] and inertia [kg m2]."""
        self.set_payload(m, cog)
        if inertia is not None:
            self._machine.tool.inertia = six(inertia, "inertia")

    def get_target_payload(self) -> float:
        return self._machine.tool.payload

    def get_target_payload_cog(self) -> list[float]:
        return list(self._machine.tool.cog)

    def get_target_payload_inertia(self) -> list[float]:
        return list(self._machine.tool.inertia)

    def _mass(self, m: Any) -> float:
        if not 0 <= number(m) <= MAX_PAYLOAD:
            raise ScriptError(f"payload of {m} kg: 0 to {MAX_PAYLOAD} kg")
        return float(m)

    def set_gravity(self, d: Any) -> None:
        """Accepted; the simulated arm stands upright."""

    def force_mode(self, task_frame: Any, selection_vector: Any, wrench: Any, type: int, limits: Any) -> None:
        """Nothing, after the arguments have been checked: nothing pushes the arm and it pushes nothing."""
        for value, name in (
            (task_frame, "task_frame"),
            (selection_vector, "selection_vector"),
            (wrench, "wrench"),
            (limits, "limits"),
        ):
            six(value, f"force_mode {name}")
        if number(type) not in FORCE_TYPES:
            raise ScriptError(f"force_mode: type = {type} is none of 1, 2, 3")

    def end_force_mode(self) -> None:
        """Nothing: there is no force mode."""

    def force_mode_set_damping(self, damping: float) -> None:
        """Nothing: there is no force mode."""

    def force_mode_set_gain_scaling(self, scaling: float) -> None:
        """Nothing: there is no force mode."""

    def zero_ftsensor(self) -> None:
        """Nothing: there is no sensor."""

    def ft_rtde_input_enable(
        self, enable: bool, sensor_mass: float = 0, sensor_measuring_offset: Any = None, sensor_cog: Any = None
    ) -> None:
        """Nothing: there is no sensor."""

    def enable_external_ft_sensor(
        self, enable: bool, sensor_mass: float = 0, sensor_measuring_offset: Any = None, sensor_cog: Any = None
    ) -> None:
        """Nothing: there is no sensor."""

    def tool_contact(self, direction: Any = None) -> int:
        """0: the tool never feels contact."""
        return 0

    def teach_mode(self) -> None:
        """Nothing: nobody pushes the arm."""

    def end_teach_mode(self) -> None:
        """Nothing: nobody pushes the arm."""

    def freedrive_mode(self, freeAxes: Any = None, feature: Any = None) -> None:
        """Nothing: nobody pushes the arm."""

    def end_freedrive_mode(self) -> None:
        """Nothing: nobody pushes the arm."""

    def get_freedrive_status(self) -> int:
        return 0
