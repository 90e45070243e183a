"""One RTDE client: set-up, data, inputs that two clients cannot share."""

import struct

import pytest

from tests.controllers import new_machine
from weldsim.controller.machine import Machine
from weldsim.controller.outputs import OutputRecipe, find_output
from weldsim.controller.profile import PROFILES
from weldsim.controller.rtde import Claims, RtdeSession
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType, unpack_values


@pytest.fixture
def machine() -> Machine:
    return new_machine("cb3")


def ask(session: RtdeSession, kind: PacketType, payload: bytes = b"") -> bytes:
    """The payload of the one answer."""
    (answer,) = PacketReader().feed(session.received(Packet(kind, payload).encode()))
    assert answer.type == kind
    return answer.payload


def outputs(session: RtdeSession, names: str, frequency: float = 125.0) -> bytes:
    return ask(session, PacketType.SETUP_OUTPUTS, struct.pack(">d", frequency) + names.encode())


def new_session(machine: Machine, claims: Claims | None = None) -> RtdeSession:
    session = RtdeSession(machine, claims or Claims())
    assert ask(session, PacketType.PROTOCOL_VERSION, b"\x00\x02") == b"\x01"
    return session


def test_versions(machine):
    session = new_session(machine)
    assert ask(session, PacketType.PROTOCOL_VERSION, b"\x00\x09") == b"\x00"
    assert struct.unpack(">4I", ask(session, PacketType.CONTROLLER_VERSION))[:2] == (3, 15)


def test_data_is_what_was_asked_for(machine):
    session = new_session(machine)
    assert session.data() == b""
    assert outputs(session, "timestamp,actual_q,runtime_state") == b"\x01DOUBLE,VECTOR6D,UINT32"
    assert ask(session, PacketType.START) == b"\x01"
    machine.tick()
    (packet,) = PacketReader().feed(session.data())
    t, q, state = unpack_values(["DOUBLE", "VECTOR6D", "UINT32"], packet.payload[1:])
    assert (packet.type, packet.payload[0]) == (PacketType.DATA, 1)
    assert (t, q, state) == (machine.t, machine.arm.q, 1)
    assert ask(session, PacketType.PAUSE) == b"\x01"
    assert session.data() == b""


def test_slower_client_gets_every_nth_packet(machine):
    session = new_session(machine)
    outputs(session, "timestamp", 25.0)
    ask(session, PacketType.START)
    sent = []
    for _ in range(20):
        machine.tick()
        sent.append(bool(session.data()))
    assert sum(sent) == 4


@pytest.mark.parametrize(
    ("series", "asked", "every"), [("cb3", 50.0, 2), ("cb3", 80.0, 1), ("e", 300.0, 1), ("e", 60.0, 8), ("e", 1e4, 1)]
)
def test_client_never_gets_fewer_packets_than_it_asked_for(series, asked, every):
    assert OutputRecipe(["timestamp"], asked, PROFILES[series]).every == every


def test_unknown_variable_cannot_be_started(machine):
    session = new_session(machine)
    assert outputs(session, "timestamp,nonsense") == b"\x00DOUBLE,NOT_FOUND"
    assert ask(session, PacketType.START) == b"\x00"


def test_first_protocol_version_has_neither_frequency_nor_numbers(machine):
    session = RtdeSession(machine, Claims())
    assert ask(session, PacketType.SETUP_OUTPUTS, b"robot_mode") == b"INT32"
    assert ask(session, PacketType.START) == b"\x01"
    machine.tick()
    (packet,) = PacketReader().feed(session.data())
    assert packet.payload == struct.pack(">i", 7)


def test_inputs_belong_to_one_client_until_it_goes(machine):
    claims = Claims()
    first, second = new_session(machine, claims), new_session(machine, claims)
    names = b"input_int_register_0,input_double_register_3"
    assert ask(first, PacketType.SETUP_INPUTS, names) == b"\x01INT32,DOUBLE"
    assert ask(first, PacketType.SETUP_INPUTS, b"input_int_register_0") == b"\x02INT32"
    assert ask(second, PacketType.SETUP_INPUTS, names) == b"\x00IN_USE,IN_USE"
    assert ask(second, PacketType.SETUP_INPUTS, b"nonsense") == b"\x00NOT_FOUND"
    assert first.received(Packet(PacketType.DATA, b"\x01" + struct.pack(">id", 7, 0.5)).encode()) == b""
    assert (machine.io.in_int[0], machine.io.in_double[3]) == (7, 0.5)
    first.ended()
    assert ask(second, PacketType.SETUP_INPUTS, names) == b"\x01INT32,DOUBLE"
    assert machine.io.in_int[0] == 7


def test_stream_that_makes_no_sense_is_hung_up_on(machine):
    session = new_session(machine)
    assert session.received(b"\x00\x00\x00") == b""
    assert session.finished


@pytest.mark.parametrize("series", ["cb3", "e"])
def test_every_known_variable_can_be_packed(series):
    from weldsim.controller.outputs import _FIXED

    machine = new_machine(series)
    machine.tick()
    names = [name for name in _FIXED if find_output(name, PROFILES[series])]
    names += ["output_bit_register_64", "output_int_register_47", "output_double_register_0", "input_double_register_47"]
    recipe = OutputRecipe(names, 0.0, PROFILES[series])
    assert recipe.complete
    assert len(unpack_values(recipe.types, recipe.pack(machine.snapshot))) == len(names)
    for name in ("ft_raw_wrench", "tool_output_mode"):
        assert (find_output(name, PROFILES[series]) is None) == (series == "cb3")
    for name in ("safety_status", "euromap67_24V_voltage", "script_control_line"):
        assert find_output(name, PROFILES[series]) is not None
