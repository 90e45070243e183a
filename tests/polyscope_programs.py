"""Programs as PolyScope exports them, written anew for tests: what it puts at the head of a file and around its nodes."""

HEAD_3 = """  modbus_add_signal("192.168.0.9", 255, 3, 0, "MODBUS_1", False)
  modbus_add_rtu_signal("/dev/ttyTool", 1, 3, 0, "MODBUS_2")
  modbus_set_signal_update_frequency("MODBUS_1", 10)
  modbus_set_runstate_dependent_choice("MODBUS_1", 0)
  set_standard_analog_input_domain(0, 1)
  set_standard_analog_input_domain(1, 1)
  set_tool_analog_input_domain(0, 1)
  set_tool_analog_input_domain(1, 1)
  set_analog_outputdomain(0, 0)
  set_analog_outputdomain(1, 0)
  set_tool_voltage(24)
  set_standard_digital_input_action(0, "default")
  set_configurable_digital_input_action(7, "default")
  set_tool_digital_input_action(1, "default")
  set_gp_boolean_input_action(63, "default")
  set_input_actions_to_default()
  set_runstate_standard_digital_output_to_value(0, 0)
  set_runstate_configurable_digital_output_to_value(7, 1)
  set_runstate_tool_digital_output_to_value(1, 2)
  set_runstate_standard_analog_output_to_value(0, 0)
  set_runstate_gp_boolean_output_to_value(63, 0)
  set_euromap_runstate_dependent_choice(0, 0)
  conveyor_pulse_decode(0, 0, 1)
  set_safety_mode_transition_hardness(1)
  set_gravity([0.0, 0.0, 9.82])
  set_tcp(p[0.0,0.048,0.227,-0.849975,0.0,0.0])
  set_payload(1.2, [0.0, 0.01, 0.05])
"""
"""Of a CB3."""
HEAD_5 = """  global _hidden_verificationVariable=0
  set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)
  set_tool_output_mode(0)
  set_tool_digital_output_mode(0, 1)
  set_tool_digital_output_mode(1, 1)
  set_tool_voltage(0)
  set_standard_analog_input_domain(0, 1)
  set_input_actions_to_default()
  set_gravity([0.0, 0.0, 9.82])
  set_tcp(p[0.0,0.048,0.227,-0.849975,0.0,0.0], "Torch")
  set_target_payload(1.200000, [0.000000, 0.010000, 0.050000], [0.000000, 0.000000, 0.000000, 0.000000, 0.000000, 0.000000])
  set_safety_mode_transition_hardness(1)
  rtde_set_watchdog("input_int_register_0", 0)
"""
"""Of an e-Series."""
COUNTER = """  step_count_1f = 0.0
  thread Step_Counter_Thread_2a():
    while (True):
      step_count_1f = step_count_1f + 1.0
      sync()
    end
  end
  run Step_Counter_Thread_2a()
"""
TIMER = """  global timer_1=0
  global timer_1_is_counting=False
  thread Timer_Thread():
    while (True):
      if (timer_1_is_counting):
        timer_1 = timer_1 + get_steptime()
      end
      sync()
    end
  end
  run Timer_Thread()
"""
GRIPPER = """  # begin: URCap Installation Node
  #   Source: Gripper, 1.2.3
  global gripper_open = False
  global rpc = rpc_factory("xmlrpc", "http://127.0.0.1:40404")
  def gripper_acknowledged(text):
    if (text[0] != 3):
      return False
    end
    return text[1] == 97
  end
  def gripper_set(name, value, socket="1"):
    local ack = False
    local tries = 0
    while (not(ack) and tries < 5):
      socket_send_string(str_cat("SET ", str_cat(name, to_str(value))), socket)
      sync()
      ack = gripper_acknowledged(socket_read_byte_list(3, socket))
      tries = tries + 1
    end
    return ack
  end
  if (not(socket_open("127.0.0.1", 63352, "1"))):
    textmsg("no gripper")
  end
  thread watch_gripper():
    while (True):
      if (get_tool_digital_in(0) == True):
        gripper_open = True
        set_flag(3, True)
      else:
        gripper_open = False
      end
      sync()
    end
  end
  watching = run watch_gripper()
  # end: URCap Installation Node
"""
POINTS = """  global Start_p=p[-.030, -.450, .200, 0.0, 3.14, 0.0]
  global Start_q=[-1.57, -1.3, -1.9, -1.5, 1.57, 0.0]
  global End_p=p[.050, -.450, .200, 0.0, 3.14, 0.0]
  global Table=p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
"""
NODES = """    $ 2 "MoveJ"
    $ 3 "Start" "breakAfter"
    movej(Start_q, a=1.3962634015954636, v=1.0471975511965976)
    $ 4 "Loop 2 times"
    global Loop_1 = 0
    while (Loop_1 < 2):
      $ 5 "MoveL"
      movel(pose_trans(Table, End_p), a=1.2, v=0.25)
      $ 6 "Call Down"
      Down()
      Loop_1 = Loop_1 + 1
    end
    $ 7 "If reached≟True"
    global reached = Loop_1 >= 2
    if (reached == True):
      $ 8 "MoveP"
      movep(Start_p, a=1.2, v=0.25)
    else:
      popup("never", "Popup", False, False, blocking=True)
    end
"""
DOWN = """  def Down():
    $ 20 "Down"
    movel(pose_trans(get_target_tcp_pose(), p[0, 0, 0.01, 0, 0, 0]), a=1.2, v=0.05)
  end
"""
ASKED = """    $ 9 "Wait DI[0]=HI"
    while (get_standard_digital_in(0) == False):
      sync()
    end
    $ 10 "Set DO[0]=Out"
    set_standard_digital_out(0, not(get_standard_digital_out(0)))
    if (get_configurable_digital_in(1) == True or gripper_set("POS", 0)):
      popup("part is missing", title="Stop", error=True)
      halt
    end
    global measured = 2 * get_standard_analog_in(0) + 1
    global answer = request_integer_from_primary_client("How many?")
    if (measured > 3):
      global far = 1
    else:
      far = 2
    end
    gripper_set("POS", 255)
    sleep(0.01)
    varmsg("measured", measured)
"""
MOVED = ["movej", *["movel", "movel"] * 2, "movep"]
"""The motions of NODES."""


def exported(head: str, *parts: str, nodes: str = NODES, looping: bool = False) -> str:
    """A program with this head, these parts after it, and its nodes, in a loop where PolyScope has one."""
    body = f'  while (True):\n    $ 1 "Robot Program"\n{nodes}  end\n' if looping else f'    $ 1 "Robot Program"\n{nodes}'
    return f"def Weld_1():\n{head}{''.join(parts)}{POINTS}{DOWN}{body}end\n"
