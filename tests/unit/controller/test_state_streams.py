"""What ports 30001 to 30003 tell without being asked, by the manufacturer's layouts."""

import math
import struct

import numpy as np
import pytest

from tests.controllers import new_machine
from weldsim.controller.machine import Machine
from weldsim.controller.primary import PrimarySession
from weldsim.controller.realtime import RealtimeSession, realtime_packet
from weldsim.controller.state_message import state_message, version_message
from weldsim.execution.primary_packet import ROBOT_STATE, MessageReader, sub_packages

SIZES = {"cb3": {0: 46, 8: 8}, "e": {0: 47, 8: 9}}  # with their headers
COMMON = {1: 251, 2: 37, 3: 74, 4: 101, 5: 225, 6: 445, 7: 61}


@pytest.fixture(params=("cb3", "e"))
def machine(request: pytest.FixtureRequest) -> Machine:
    machine = new_machine(request.param)
    machine.set_tcp([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    machine.io.set_digital_out(3, True)
    machine.io.slider = 0.5
    assert machine.upload("def turning():\n speedj([0.2, 0, 0, 0, 0, 0.1], 2, 10)\nend\n")
    for _ in range(100):
        machine.tick()
    return machine


def told(machine: Machine) -> dict[int, bytes]:
    """Contents of the sub-packages of one state message."""
    ((kind, contents),) = MessageReader().feed(state_message(machine))
    assert kind == ROBOT_STATE
    return dict(sub_packages(contents))


def test_sub_packages_have_the_sizes_of_their_series(machine):
    sizes = {kind: 5 + len(contents) for kind, contents in told(machine).items()}
    assert sizes == COMMON | SIZES[machine.profile.series]


def test_state_is_that_of_the_arm(machine):
    packages = told(machine)
    t, *flags, mode, _, fraction, scaling, limit = struct.unpack_from(">Q7BBBddd", packages[0])
    assert (t, flags, mode) == (round(machine.t * 1e6), [1, 1, 1, 0, 0, 1, 0], 7)
    assert (fraction, scaling, limit) == (0.5, 1.0, 1.0)
    joints = np.array([struct.unpack_from(">dddffffB", packages[1], 41 * k) for k in range(6)])
    np.testing.assert_array_equal(joints[:, 0], machine.arm.q)
    np.testing.assert_array_equal(joints[:, 2], machine.arm.qd)
    assert (joints[:, 7] == 253).all()
    pose = struct.unpack(">12d", packages[4])
    np.testing.assert_allclose(pose, [*machine.snapshot.tcp_pose, *machine.tool.tcp])
    assert struct.unpack_from(">ii", packages[3]) == (0, 8)
    limits = struct.unpack(">24d5d24d4i", packages[6])
    assert (limits[0], limits[1], limits[12]) == (-2 * math.pi, 2 * math.pi, math.pi)
    np.testing.assert_array_equal(np.array(limits[29:53]).reshape(4, 6), machine.kinematics.dh.T[[1, 2, 3, 0]])


def test_realtime_packet_is_the_period_in_doubles(machine):
    packet = realtime_packet(machine.snapshot)
    assert struct.unpack_from(">i", packet) == (len(packet),) == (1220,)
    v = struct.unpack_from(">152d", packet, 4)
    now = machine.snapshot
    for at, expected in (
        (0, [now.t]),
        (1, now.q_target),
        (31, now.q),
        (37, now.qd),
        (55, now.tcp_pose),
        (61, now.tcp_speed),
        (73, now.tcp_pose_target),
        (85, [0, *[30.0] * 6]),
        (94, [7, *[253] * 6, 1]),
        (108, now.tool_acceleration),
        (117, [1.0]),
        (121, [48.0, 48.0, 0.5, *[48.0] * 6]),
        (130, [8, 2]),
        (132, [*now.elbow, *now.elbow_speed, 1]),
        (142, [now.payload, *now.payload_cog, *now.payload_inertia]),
    ):
        np.testing.assert_allclose(v[at : at + len(expected)], expected, err_msg=f"double {at}")


def test_version_comes_first_and_nothing_at_once(machine, monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("time.perf_counter", lambda: clock[0])
    primary, realtime = PrimarySession(machine), RealtimeSession(machine)
    assert primary.data() == realtime.data() == b""
    clock[0] += 0.11
    assert primary.data() == version_message(machine) + state_message(machine)
    assert primary.data() == b""
    assert realtime.data() == realtime_packet(machine.snapshot)
    clock[0] += 0.11
    assert primary.data() == state_message(machine)


def test_programs_are_taken_beside_the_stream(machine):
    for session in (PrimarySession(machine), RealtimeSession(machine)):
        machine.stop_program()
        assert session.received(b"def sent():\n sync()\n sync()\nend\n") == b""
        assert machine.program_name == "sent"
