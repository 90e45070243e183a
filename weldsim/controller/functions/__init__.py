"""The functions that URScript programs can call, gathered from the nouns they are about."""

from collections.abc import Callable

from weldsim.controller.functions.accepted import accepted
from weldsim.controller.functions.geometry import GeometryFunctions
from weldsim.controller.functions.installation import InstallationFunctions
from weldsim.controller.functions.motion import MotionFunctions
from weldsim.controller.functions.robot import RobotFunctions
from weldsim.controller.functions.signals import SignalFunctions
from weldsim.controller.functions.system import SystemFunctions
from weldsim.controller.machine import Machine
from weldsim.urscript.geometry import PoseFunctions
from weldsim.urscript.numbers import NumberFunctions
from weldsim.urscript.strings import StringFunctions

E_ONLY = frozenset(
    [
        "tool_contact",
        "get_actual_joint_positions_history",
        "get_target_payload",
        "get_target_payload_cog",
        "get_target_payload_inertia",
        "set_target_payload",
        "force_mode_set_gain_scaling",
        "get_target_waypoint",
        "get_freedrive_status",
        "ft_rtde_input_enable",
        "set_tool_communication",
        "set_tool_output_mode",
        "set_tool_digital_output_mode",
        "high_holding_torque_enable",
        "high_holding_torque_disable",
        "modbus_add_rw_signal",
        "modbus_request_update_signal_value",
        "modbus_reset_connection",
    ]
)
"""Functions that a CB3 controller does not have."""


def elsewhere(machine: Machine) -> frozenset[str]:
    """Functions that an e-Series has and this controller has not."""
    return frozenset() if machine.profile.series == "e" else E_ONLY


def builtins(machine: Machine) -> dict[str, Callable]:
    """{name: function} for programs on this controller; those that take time are generator functions."""
    groups = (
        MotionFunctions(machine),
        GeometryFunctions(machine),
        RobotFunctions(machine),
        SignalFunctions(machine),
        SystemFunctions(machine),
        InstallationFunctions(machine),
        PoseFunctions(),
        NumberFunctions(),
        StringFunctions(),
    )
    found = accepted(machine)
    found |= {name: getattr(group, name) for group in groups for name in dir(group) if not name.startswith("_")}
    return {name: f for name, f in found.items() if machine.profile.series == "e" or name not in E_ONLY}
