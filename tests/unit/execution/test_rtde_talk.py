"""A controller that another client commands: found out without disturbing it, and left to it."""

import socket
import struct

import pytest

from tests.controllers import PATIENCE, free_address, served, wait_for
from weldsim.controller.ask import ask
from weldsim.errors import ExecutionError
from weldsim.execution.rtde_packet import PacketType
from weldsim.execution.rtde_talk import COMMAND_REGISTER, LinkError, RtdeTalk, commanded_by_another
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_ports import REALTIME
from weldsim.execution.ur_robot import UrRobot

PROGRAM = b"def mine():\n  while True:\n    sync()\n  end\nend\n"


def test_a_controller_that_another_client_commands_is_left_to_it() -> None:
    with served() as host:
        assert not commanded_by_another(host, PATIENCE)
        assert not commanded_by_another(host, PATIENCE)  # asking holds nothing
        first = RtdeTalk(host, PATIENCE)
        assert first.ask(PacketType.SETUP_INPUTS, COMMAND_REGISTER.encode())[1:] == b"INT32"
        with socket.create_connection((host, REALTIME), PATIENCE) as sock:
            sock.sendall(PROGRAM)
            assert wait_for(lambda: ask(host, {"status": True})["program"] == "mine")
        assert commanded_by_another(host, PATIENCE)
        robot = UrRobot(UrConfig(host=host, connect_timeout=PATIENCE))
        with pytest.raises(ExecutionError, match="another client") as caught:
            robot.connect()
        assert caught.value.data["rule"] == "other_client"
        assert ask(host, {"status": True})["program"] == "mine"
        assert len(first.ask(PacketType.CONTROLLER_VERSION, b"")) == struct.calcsize(">4I")
        first.close()
        assert wait_for(lambda: not commanded_by_another(host, PATIENCE))


def test_nobody_there() -> None:
    with pytest.raises(LinkError, match="port 30004"):
        commanded_by_another(free_address(), 1.0)
