"""Functions that programs call and for which the twin has no part: they are accepted, do nothing, and answer as if nothing were
connected. PolyScope writes many of them at the head of every program.
"""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

from weldsim.controller.machine import Machine


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


NOTHING = _words(
    """
    set_tool_communication set_tool_output_mode set_tool_digital_output_mode set_tool_analog_out set_standard_digital_outputs
    set_runstate_standard_digital_outputs set_runstate_standard_analog_output_to_value set_runstate_gp_boolean_output_to_value
    set_gp_boolean_input_action set_euromap_output set_euromap_runstate_dependent_choice modbus_add_signal modbus_add_rw_signal
    modbus_add_rtu_signal modbus_delete_signal modbus_set_output_signal modbus_set_output_register
    modbus_set_signal_update_frequency modbus_set_signal_watchdog modbus_set_runstate_dependent_choice
    modbus_set_digital_input_action modbus_request_update_signal_value modbus_reset_connection modbus_send_custom_command
    socket_close write_port_bit write_port_register reset_revolution_counter position_deviation_warning pause_on_error_code
    high_holding_torque_enable high_holding_torque_disable path_offset_disable path_offset_set_alpha_filter
    path_offset_set_max_offset end_screw_driving conveyor_pulse_decode set_conveyor_tick_count encoder_enable_pulse_decode
    encoder_enable_set_tick_count encoder_set_tick_count stop_conveyor_tracking assert
    """
)
"""Do nothing."""
ANSWERS: dict[str, Any] = {
    "socket_open": False,
    **dict.fromkeys(_words("socket_send_string socket_send_line socket_send_byte socket_send_int socket_set_var"), False),
    **dict.fromkeys(_words("socket_read_string socket_read_line"), ""),
    **{key: [0] for key in _words("socket_read_ascii_float socket_read_binary_integer socket_read_byte_list")},
    "socket_get_var": 0,
    **dict.fromkeys(_words("modbus_get_signal_status modbus_get_error read_port_register"), 0),
    "modbus_get_time_since_signal_invalid": 0.0,
    **dict.fromkeys(_words("read_port_bit get_euromap_input get_euromap_output"), False),
    **dict.fromkeys(_words("get_conveyor_tick_count encoder_get_tick_count encoder_unwind_delta_tick_count"), 0),
    **dict.fromkeys(_words("get_analog_in get_analog_out get_tool_analog_out"), 0.0),
    "get_tool_accelerometer_reading": [0.0, 0.0, 0.0],
    **dict.fromkeys(_words("path_offset_get get_target_tcp_speed_along_path"), [0.0] * 6),
    "tool_contact_examples": 0,
    "rpc_factory": "rpc",
    "request_boolean_from_primary_client": False,
    "request_integer_from_primary_client": 0,
    "request_float_from_primary_client": 0.0,
    "request_string_from_primary_client": "",
}
"""What is answered where nothing is connected and nobody stands at the pendant."""


def accepted(machine: Machine) -> dict[str, Callable]:
    """{name: function} of all these; what a program asks a person or writes for one is in the log."""

    def varmsg(name: Any, value: Any = "") -> None:
        machine.say(f"{name}: {value}")

    out: dict[str, Callable] = {name: _answering(None) for name in NOTHING}
    return out | {name: _answering(value) for name, value in ANSWERS.items()} | {"varmsg": varmsg}


def _answering(value: Any) -> Callable:
    return lambda *_, **__: deepcopy(value)
