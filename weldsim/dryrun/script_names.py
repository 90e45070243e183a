"""Functions of URScript that a dry run knows by name, and what it makes of them; any other is refused."""


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


MOVING = _words(
    """
    optimovej optimovel speedj speedl speedl_at servoc servol force_mode force_mode_example teach_mode freedrive_mode
    freedrive_mode_no_incorrect_payload_check screw_driving path_offset_enable path_offset_set track_conveyor_linear
    track_conveyor_circular move_until_contact direct_torque
    """
)
"""Move the arm in a way that is not checked: refused."""
ASKING = _words(
    """
    get_digital_in get_standard_digital_in get_configurable_digital_in get_tool_digital_in get_digital_out
    get_standard_digital_out get_configurable_digital_out get_tool_digital_out get_analog_in get_standard_analog_in
    get_tool_analog_in get_analog_out get_standard_analog_out get_tool_analog_out get_euromap_input get_euromap_output get_flag
    get_tcp_force force get_joint_torques get_joint_temp get_actual_joint_speeds get_target_joint_speeds
    get_actual_joint_positions_history get_actual_tcp_speed get_target_tcp_speed get_target_waypoint get_controller_temp
    get_tool_current get_tool_accelerometer_reading get_target_payload get_target_payload_cog get_target_payload_inertia
    get_target_tcp_speed_along_path get_freedrive_status path_offset_get
    read_input_integer_register read_input_float_register read_input_boolean_register read_output_integer_register
    read_output_float_register read_output_boolean_register read_port_bit read_port_register modbus_get_signal_status
    modbus_get_error modbus_get_time_since_signal_invalid socket_open socket_read_string socket_read_line
    socket_read_ascii_float socket_read_byte_list socket_read_binary_integer socket_get_var
    request_boolean_from_primary_client request_integer_from_primary_client request_float_from_primary_client
    request_string_from_primary_client is_steady tool_contact tool_contact_examples get_steptime random rpc_factory
    get_conveyor_tick_count encoder_get_tick_count encoder_unwind_delta_tick_count
    is_within_safety_limits
    """
)
"""Ask the robot or somebody else: nothing may be decided by their answer."""
SILENT = _words(
    """
    textmsg popup varmsg assert sync set_payload set_payload_mass set_payload_cog set_target_payload set_gravity set_analog_out
    set_standard_analog_out set_tool_analog_out set_analog_outputdomain set_analog_inputrange set_tool_voltage set_flag
    set_standard_analog_input_domain set_tool_analog_input_domain set_tool_digital_output_mode set_tool_output_mode
    set_tool_communication write_output_integer_register write_output_float_register write_output_boolean_register write_port_bit
    write_port_register modbus_add_signal modbus_add_rtu_signal modbus_add_rw_signal modbus_delete_signal modbus_set_output_signal
    modbus_set_output_register modbus_set_signal_update_frequency modbus_set_signal_watchdog modbus_set_runstate_dependent_choice
    modbus_set_digital_input_action modbus_request_update_signal_value modbus_reset_connection modbus_send_custom_command
    socket_send_string socket_send_line socket_send_byte socket_send_int socket_set_var socket_close rtde_set_watchdog
    zero_ftsensor ft_rtde_input_enable enable_external_ft_sensor end_force_mode end_freedrive_mode end_teach_mode
    end_screw_driving set_runstate_standard_digital_outputs set_runstate_standard_digital_output_to_value
    set_runstate_configurable_digital_output_to_value set_runstate_tool_digital_output_to_value
    set_runstate_standard_analog_output_to_value set_runstate_gp_boolean_output_to_value set_standard_digital_input_action
    set_configurable_digital_input_action set_tool_digital_input_action set_gp_boolean_input_action set_input_actions_to_default
    set_euromap_output set_euromap_runstate_dependent_choice set_safety_mode_transition_hardness set_standard_digital_outputs
    force_mode_set_damping force_mode_set_gain_scaling reset_revolution_counter reset_world_model position_deviation_warning
    pause_on_error_code high_holding_torque_enable high_holding_torque_disable path_offset_disable
    path_offset_set_alpha_filter path_offset_set_max_offset conveyor_pulse_decode set_conveyor_tick_count
    encoder_enable_pulse_decode encoder_enable_set_tick_count encoder_set_tick_count stop_conveyor_tracking powerdown
    protective_stop
    """
)
"""Do not move the arm: passed over."""
RESTING = ("stopj", "stopl")
"""What moves is at rest already."""
OUTPUTS = ("set_digital_out", "set_standard_digital_out", "set_configurable_digital_out", "set_tool_digital_out")
"""May strike the arc."""
CHECKED = ("movej", "movel", "movep", "movec", "servoj")
"""Move the arm, and are checked."""
MOVES = frozenset((*CHECKED, *MOVING, *RESTING, "set_tcp"))
"""What a statement must not call that is passed over: it moves the arm, stops it, or changes what poses mean."""
