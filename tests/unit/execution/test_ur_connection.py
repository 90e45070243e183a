"""UrRobot and controllers that answer nothing, or wrongly: an error in time, one line, nothing left behind."""

import contextlib
import os
import selectors
import socket
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from tests.controllers import PATIENCE, free_address, wait_for
from tests.machine import Watch
from weldsim.errors import ConfigError, ExecutionError
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType
from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_dashboard import Dashboard, switch_off
from weldsim.execution.ur_link import ON_ITS_WAY, PROOF, _first, _skip_old
from weldsim.execution.ur_ports import DASHBOARD, RTDE, SECONDARY
from weldsim.execution.ur_process import ClientError, ClientProcess
from weldsim.execution.ur_robot import UrRobot
from weldsim.execution.ur_status import follow_distance, mode_word, program_trouble, safety_trouble
from weldsim.execution.ur_stream import Sample, StateStream

TIMEOUT = 1.0  # [s] the least that connect_timeout may be


class Listener:
    """Ports that accept, say `greeting`, and answer with `answer(port, data)`; nothing by default."""

    def __init__(self, host: str, ports: tuple[int, ...]) -> None:
        self.heard: dict[int, bytes] = dict.fromkeys(ports, b"")
        self.selector = selectors.DefaultSelector()
        self.running = True
        for port in ports:
            self.selector.register(socket.create_server((host, port)), selectors.EVENT_READ, ("listen", port))
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def greeting(self, port: int) -> bytes:
        return b""

    def answer(self, port: int, data: bytes) -> bytes:
        return b""

    def run(self) -> None:
        while self.running:
            for key, _ in self.selector.select(0.05):
                what, port = key.data
                sock = key.fileobj
                assert isinstance(sock, socket.socket)
                if what == "listen":
                    client, _ = sock.accept()
                    with contextlib.suppress(OSError):  # it may have hung up before it was served
                        client.sendall(self.greeting(port))
                    self.selector.register(client, selectors.EVENT_READ, ("client", port))
                    continue
                data = b""
                with contextlib.suppress(OSError):
                    data = sock.recv(4096)
                self.heard[port] += data
                if data:
                    with contextlib.suppress(OSError):
                        sock.sendall(self.answer(port, data))
                else:
                    self.selector.unregister(sock)
                    sock.close()

    def close(self) -> None:
        self.running = False
        self.thread.join()
        for key in list(self.selector.get_map().values()):
            assert isinstance(key.fileobj, socket.socket)
            key.fileobj.close()
        self.selector.close()


@pytest.fixture
def host() -> str:
    return free_address()


@contextlib.contextmanager
def listening(host: str, *ports: int, kind: type[Listener] = Listener) -> Iterator[Listener]:
    listener = kind(host, ports)
    try:
        yield listener
    finally:
        listener.close()


def refusal(host: str, **settings: object) -> tuple[ExecutionError, float]:
    """The error of connecting, and how long [s] it took, without what this machine took."""
    robot = UrRobot(UrConfig(host=host, **{"connect_timeout": TIMEOUT} | settings))  # type: ignore[arg-type]
    with Watch() as watch:
        began = watch.clock()
        with pytest.raises(ExecutionError) as caught:
            robot.connect()
        with pytest.raises(ExecutionError, match="connect"):
            robot.servo(np.zeros(6), np.zeros(6))
        robot.disconnect()
        return caught.value, watch.clock() - began


def test_nobody_there(host: str) -> None:
    error, took = refusal(host)
    assert error.data["rule"] == "connection"
    assert str(DASHBOARD) in str(error)
    assert took < 0.5


def test_a_dashboard_that_says_nothing(host: str) -> None:
    with listening(host, DASHBOARD, RTDE):
        error, took = refusal(host)
    assert "does not answer" in str(error)
    assert took < 2 * TIMEOUT


class Talker(Listener):
    """A dashboard of a CB3; RTDE accepts and is silent."""

    REPLIES = {  # noqa: RUF012 - never changed
        "PolyscopeVersion": "URSoftware 3.15.8.106339",
        "get robot model": "UR5",
        "get serial number": "1",
        "programState": "STOPPED",
        "stop": "Stopped",
    }

    def greeting(self, port: int) -> bytes:
        return b"Connected\n" if port == DASHBOARD else b""

    def answer(self, port: int, data: bytes) -> bytes:
        lines = data.decode().splitlines() if port == DASHBOARD else []
        return "".join(self.REPLIES.get(line, "?") + "\n" for line in lines).encode()


def test_an_rtde_port_that_says_nothing(host: str) -> None:
    with listening(host, DASHBOARD, RTDE, kind=Talker) as listener:
        error, took = refusal(host)
        assert b"stop" not in listener.heard[DASHBOARD]  # whose program it is has not been found out
    assert "RTDE" in str(error)
    assert took < 2.5 * TIMEOUT


class Local(Talker):
    """An e-Series in local control."""

    REPLIES = Talker.REPLIES | {"PolyscopeVersion": "URSoftware 5.11.1", "is in remote control": "false"}


def test_local_control_is_named_and_nothing_is_stopped(host: str) -> None:
    with listening(host, DASHBOARD, RTDE, kind=Local) as listener:
        error, _ = refusal(host, connect_timeout=PATIENCE)
        assert b"stop\n" not in listener.heard[DASHBOARD]
    assert error.data["rule"] == "remote_control"


class Old(Talker):
    """RTDE of a controller that does not know `runtime_state`."""

    def answer(self, port: int, data: bytes) -> bytes:
        if port == DASHBOARD:
            return super().answer(port, data)
        replies = []
        for packet in PacketReader().feed(data):
            payload = b"\x01" + b"\0" * 15
            if packet.type == PacketType.SETUP_OUTPUTS:
                names = packet.payload[8:].decode().split(",")
                payload = b"\x00" + ",".join("NOT_FOUND" if name == "runtime_state" else "DOUBLE" for name in names).encode()
            replies.append(Packet(packet.type, payload).encode())
        return b"".join(replies)


def test_a_controller_that_does_not_report_what_is_needed(host: str) -> None:
    with listening(host, DASHBOARD, RTDE, kind=Old):
        error, _ = refusal(host, connect_timeout=PATIENCE)
    assert "runtime_state" in str(error)


def test_a_stream_of_nonsense_is_refused(host: str) -> None:
    class Nonsense(Talker):
        def answer(self, port: int, data: bytes) -> bytes:
            return b"\0\1V\xff" * 64

    with listening(host, RTDE, kind=Nonsense), pytest.raises(LinkError):
        StateStream(host, TIMEOUT)


def test_output_is_switched_off_by_a_program_of_its_own(host: str) -> None:
    with listening(host, SECONDARY) as listener:
        assert switch_off(host, 3, PATIENCE)
        assert wait_for(lambda: b"set_standard_digital_out(3, False)" in listener.heard[SECONDARY])
        assert listener.heard[SECONDARY].startswith(b"sec ")
    assert not switch_off(host, 3, TIMEOUT)


def test_dashboard_hangs_up(host: str) -> None:
    with listening(host, DASHBOARD, kind=Talker), Dashboard(host, PATIENCE) as dashboard:
        assert dashboard.identity().software == "3.15.8"
        assert dashboard.identity().remote_control is None


def test_client_process_that_cannot_connect_is_ended(host: str) -> None:
    """The library's own constructor waits for ever for a controller that accepts and says nothing."""
    pytest.importorskip("rtde_control", reason="the extra `ur` is not installed")
    from weldsim.execution.ur_link import client_settings

    with listening(host, DASHBOARD, RTDE):
        process = ClientProcess(client_settings(UrConfig(host=host), 0.008), 0.1)
        with pytest.raises(ClientError, match="not ready within"):
            process.wait_ready(1.0)
        assert not process.close(0.2)
        assert not os.path.exists(f"/proc/{process.pid}")
    process.kill()
    with pytest.raises(ClientError):
        process.servo([0.0] * 6, False)


def sample(**changed: object) -> Sample:
    values: dict = {
        "arrived": 0.0,
        "timestamp": 1.0,
        "actual_q": [0.0] * 6,
        "actual_qd": [0.0] * 6,
        "target_q": [0.0] * 6,
        "actual_TCP_pose": [0.0] * 6,
        "actual_digital_output_bits": 0,
        "robot_mode": 7,
        "safety_mode": 1,
        "runtime_state": 2,
        "output_int_register_0": 1,
        "safety_status_bits": 1,
    }
    return Sample(**(values | changed))


class Lots(StateStream):
    """A stream of states that come in lots, each read at one moment; a lot is read when it is waited for."""

    def __init__(self, lots: list[list[dict]]) -> None:
        self.lots: list[list[dict]] = lots
        self.waiting: list[Sample] = []

    def wait(self, seconds: float) -> bool:
        if not self.waiting and self.lots:
            time.sleep(0.002)
            now = time.monotonic()
            self.waiting = [sample(arrived=now, **each) for each in self.lots.pop(0)]
        return bool(self.waiting)

    def take(self) -> Sample:
        return self.waiting.pop(0)


@pytest.mark.parametrize("held_up", [0, 3, 40])
def test_a_payload_is_not_read_back_from_states_that_were_sent_before_it_was_set(held_up: int) -> None:
    config = UrConfig()
    old = [{"timestamp": 0.008 * k, "payload": 0.0, "payload_cog": [0.0] * 3} for k in range(1 + held_up)]
    new = [[{"timestamp": 1 + 0.008 * k, "payload": config.payload, "payload_cog": list(config.payload_cog)}] for k in range(9)]
    stream = Lots([old[:1], old[1:], *new] if held_up else [old, *new])
    assert stream.wait(1.0)  # the first lot has been read before, and nobody has looked at it
    _skip_old(stream, 1.0)
    first = _first(stream, config)
    assert first.payload == config.payload
    assert 1 <= first.timestamp < 1 + 0.008 * (3 + ON_ITS_WAY)


def test_a_payload_may_take_a_moment_and_one_that_never_comes_is_told() -> None:
    config = UrConfig()
    late = [[{"payload": 0.0 if k < 5 else config.payload, "payload_cog": list(config.payload_cog)}] for k in range(9)]
    stream = Lots(late)
    assert _first(stream, config).payload == config.payload
    never = Lots([[{"payload": 0.0}]] * 10_000)
    began = time.monotonic()
    assert _first(never, config).payload == 0.0
    assert time.monotonic() - began >= PROOF


@pytest.mark.parametrize(
    ("changed", "rule", "word"),
    [
        ({"safety_mode": 3, "safety_status_bits": 1 << 2}, "protective_stop", "protective_stop"),
        ({"safety_mode": 7, "robot_mode": 3}, "emergency_stop", "robot_emergency_stop"),
        ({"safety_mode": 6}, "emergency_stop", "system_emergency_stop"),
        ({"safety_mode": 5}, "safety", "safeguard_stop"),
        ({"safety_mode": 9}, "safety", "fault"),
        ({"safety_mode": 42}, "safety", "unknown (42)"),
        ({"robot_mode": 5}, "robot_mode", "idle"),
        ({"runtime_state": 1}, "program", "stopped"),
        ({"runtime_state": 4}, "program", "paused"),
        ({}, None, "running"),
        ({"safety_mode": 2}, None, "running"),
    ],
)
def test_states_are_told_apart(changed: dict, rule: str | None, word: str) -> None:
    now = sample(**changed)
    trouble = safety_trouble(now) or program_trouble(now, None)
    assert (trouble.rule if trouble else None) == rule
    assert mode_word(now) == word or now.safety_mode == 2
    if trouble is not None:
        error = trouble.error("UR", 1.5)
        assert "\n" not in str(error)
        assert error.data["rule"] == rule
        assert error.data["value"] != error.data["limit"]


def test_the_target_is_compared_with_every_command_of_late() -> None:
    rng = np.random.default_rng(0)
    commands = rng.normal(size=(50, 6)).tolist()
    assert follow_distance(commands[17], commands) == 0.0
    off = np.array(commands[3]) + np.array([0, 0, 0.01, 0, 0, 0])
    assert follow_distance(off.tolist(), commands) == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("host", "10.0.0.1:30004"),
        ("host", ""),
        ("tcp", (0.0, 48.0, 227.0, 0.0, 0.0, 0.0)),
        ("tcp", (0.0, 0.0, 0.2, 48.7, 0.0, 0.0)),
        ("payload_cog", (0.0, 80.0, 0.0)),
        ("stall", 0.2),
        ("answer_timeout", 0.2),
    ],
)
def test_settings_that_make_no_sense_are_refused(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=f"ur.{key}"):
        UrConfig(**{key: value})  # type: ignore[arg-type]
