"""The arm's own figures out of a primary interface: whole, or one word of why not, in time, whatever is sent."""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from tests.controllers import PATIENCE as AT_LAST
from tests.controllers import free_address
from tests.machine import Watch
from weldsim.execution.primary_packet import (
    HEADER,
    KINEMATICS_INFO,
    MAX_SIZE,
    MODE_DATA,
    ROBOT_MESSAGE,
    ROBOT_STATE,
    KinematicsInfo,
    MessageReader,
    PrimaryError,
    framed,
    kinematics_in,
)
from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_arm import PATIENCE, read_arm, tell_arm
from weldsim.execution.ur_ports import PRIMARY, PRIMARY_READ_ONLY
from weldsim.kinematics import DH

INFO = KinematicsInfo(DH + np.arange(24).reshape(6, 4) * 1e-4, 2, (1, 2, 3, 4, 5, 0xFFFFFFFF))
MODE = framed(MODE_DATA, bytes(42))
STATE = framed(ROBOT_STATE, MODE + framed(KINEMATICS_INFO, INFO.encode()) + framed(7, bytes(56)))
VERSION = framed(ROBOT_MESSAGE, bytes(50))
OTHER = VERSION + framed(ROBOT_STATE, MODE)  # what says nothing of the arm
PROMPT = 0.3  # [s]


def figures(stream: bytes) -> KinematicsInfo | None:
    """The first figures in a whole stream of messages."""
    states = (contents for kind, contents in MessageReader().feed(stream) if kind == ROBOT_STATE)
    return next((found for state in states if (found := kinematics_in(state)) is not None), None)


def test_the_layout_is_the_published_one() -> None:
    """225 bytes: a header, six checksums, theta, a, d, alpha six each, and the status, big-endian."""
    package = framed(KINEMATICS_INFO, INFO.encode())
    assert len(package) == 225
    assert package[:5] == b"\0\0\0\xe1\x05"
    assert package[5:29] == struct.pack(">6I", *INFO.checksums)
    for at, column in zip((29, 77, 125, 173), range(4), strict=True):
        assert package[at : at + 48] == struct.pack(">6d", *INFO.dh[:, column])
    assert package[221:] == b"\0\0\0\x02"


@pytest.mark.parametrize("size", [1, 3, 64, 10_000])
def test_pieces_and_other_messages_do_not_matter(size: int) -> None:
    stream, reader, found = OTHER + STATE, MessageReader(), []
    for k in range(0, len(stream), size):
        found += [kinematics_in(contents) for kind, contents in reader.feed(stream[k : k + size]) if kind == ROBOT_STATE]
    assert found[0] is None
    assert found[1] is not None
    assert (found[1].dh == INFO.dh).all()
    assert (found[1].status, found[1].checksums) == (INFO.status, INFO.checksums)


def test_a_status_of_one_byte_is_taken() -> None:
    found = KinematicsInfo.decode(INFO.encode()[:-4] + b"\x02")
    assert (found.dh == INFO.dh).all()
    assert found.status == 2


@pytest.mark.parametrize("length", [0, 1, 215, 216, 218, 219, 221, 300])
def test_another_length_is_refused(length: int) -> None:
    with pytest.raises(PrimaryError, match=f"{length} bytes"):
        KinematicsInfo.decode(INFO.encode().ljust(300, b"\0")[:length])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e9, 1e308])
@pytest.mark.parametrize("place", [(0, 0), (3, 1), (5, 2), (2, 3)])
def test_figures_that_no_arm_has_are_refused(value: float, place: tuple[int, int]) -> None:
    dh = DH.copy()
    dh[place] = value
    with pytest.raises(PrimaryError, match="beyond"):
        KinematicsInfo.decode(KinematicsInfo(dh, 2).encode())


def test_spoilt_streams_give_the_figures_an_error_or_nothing() -> None:
    """Truncated, lengthened, overwritten, shuffled: never anything but a PrimaryError, never figures out of nothing."""
    rng, outcomes = np.random.default_rng(0), {"figures": 0, "refused": 0, "nothing": 0}
    for _ in range(4000):
        data = bytearray(OTHER + STATE)
        match rng.integers(4):
            case 0:
                del data[rng.integers(len(data)) :]
            case 1:
                for _ in range(rng.integers(1, 4)):
                    data[rng.integers(len(data))] = rng.integers(256)
            case 2:
                at = rng.integers(len(data))
                data[at:at] = rng.bytes(rng.integers(1, 20))
            case _:
                at = rng.integers(0, len(data) - 4)
                data[at : at + 4] = struct.pack(">i", rng.choice([-1, 0, 4, 5, 6, 1000, MAX_SIZE, MAX_SIZE + 1, 2**31 - 1]))
        try:
            found = figures(bytes(data))
        except PrimaryError:
            outcomes["refused"] += 1
            continue
        outcomes["nothing" if found is None else "figures"] += 1
        if found is not None:
            assert np.isfinite(found.dh).all()
    assert min(outcomes.values()) > 100, outcomes


@pytest.mark.parametrize(
    "state",
    [
        MODE + framed(KINEMATICS_INFO, INFO.encode()) * 2,
        MODE[:-1],
        MODE + b"\0",
        HEADER.pack(4, KINEMATICS_INFO),
        HEADER.pack(-1, KINEMATICS_INFO),
        HEADER.pack(300, KINEMATICS_INFO) + INFO.encode(),
    ],
)
def test_sub_packages_that_do_not_fill_their_message_are_refused(state: bytes) -> None:
    with pytest.raises(PrimaryError, match="robot state"):
        kinematics_in(state)


@contextlib.contextmanager
def serving(talk: Callable[[socket.socket], None], port: int = PRIMARY) -> Iterator[str]:
    """The address of somebody who talks so to whoever connects, and hangs up then."""
    host = free_address()
    with socket.create_server((host, port)) as listener:

        def serve() -> None:
            with contextlib.suppress(OSError):
                client, _ = listener.accept()
                with client:
                    talk(client)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield host
    thread.join(AT_LAST)


def wait(sock: socket.socket) -> None:
    """Until the other side hangs up."""
    sock.recv(1)


def trickle(sock: socket.socket) -> None:
    """A message without an end, a byte at a time."""
    sock.sendall(HEADER.pack(MAX_SIZE, ROBOT_STATE))
    while True:
        sock.sendall(b"\0")
        time.sleep(0.02)


def flood(sock: socket.socket) -> None:
    """All the network takes, and nothing of the arm."""
    while True:
        sock.sendall(OTHER * 500)


CASES: list[tuple[Callable[[socket.socket], None], str, float]] = [
    (lambda sock: sock.sendall(b""), "closed", 0.0),
    (lambda sock: sock.sendall(OTHER), "closed", 0.0),
    (lambda sock: sock.sendall(STATE[:-80]), "closed", 0.0),
    (lambda sock: wait(sock), "silent", PATIENCE),
    (lambda sock: (sock.sendall(OTHER), wait(sock))[-1], "silent", PATIENCE),
    (trickle, "silent", PATIENCE),
    (flood, "silent", PATIENCE),
    (lambda sock: sock.sendall(b"HTTP/1.1 400 Bad Request\r\n"), "garbled", 0.0),
    (lambda sock: sock.sendall(framed(ROBOT_STATE, framed(KINEMATICS_INFO, bytes(100)))), "garbled", 0.0),
    (lambda sock: sock.sendall(np.random.default_rng(0).bytes(5000)), "garbled", 0.0),
]


@pytest.mark.parametrize(("talk", "word", "seconds"), CASES)
def test_who_does_not_tell_costs_half_a_second_at_most(talk: Callable[[socket.socket], None], word: str, seconds: float) -> None:
    with serving(talk) as host, Watch() as watch:
        began = watch.clock()
        told = tell_arm(host) if seconds else tell_arm(host, AT_LAST)
        took = watch.clock() - began
    assert (told.dh, told.note) == (None, word)
    assert took <= seconds + PROMPT


def test_nobody_there_is_said_at_once() -> None:
    host = free_address()
    with Watch() as watch:
        began = watch.clock()
        with pytest.raises(LinkError, match=f"{PRIMARY_READ_ONLY}: closed"):
            read_arm(host)
        assert watch.clock() - began < PROMPT


@pytest.mark.parametrize("port", [PRIMARY, PRIMARY_READ_ONLY])
@pytest.mark.parametrize(("status", "note"), [(0, "not calibrated"), (2, "calibrated"), (7, "calibration status 7")])
def test_either_port_tells_the_figures_and_how_good_they_are(port: int, status: int, note: str) -> None:
    state = framed(ROBOT_STATE, MODE + framed(KINEMATICS_INFO, KinematicsInfo(INFO.dh, status).encode()))
    with serving(lambda sock: sock.sendall(OTHER + state), port) as host:
        told = tell_arm(host, AT_LAST)
    assert told.dh is not None
    assert (told.dh == INFO.dh).all()
    assert told.note == note
