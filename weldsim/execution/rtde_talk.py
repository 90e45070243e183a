"""A conversation with a UR controller's RTDE port: one request, one answer, none waited for without end.

UR RTDE guide, protocol version 2.
"""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import suppress

from weldsim.errors import InputError, WeldsimError
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType
from weldsim.execution.ur_ports import RTDE

RECEIVE_SIZE = 65536
PROTOCOL = 2
COMMAND_REGISTER = "input_int_register_0"  # ur_rtde's control client claims it first, whatever the software


class LinkError(WeldsimError):
    """The connection is gone, or was refused. `data`: none."""


class RtdeTalk:
    """A connection that speaks version 2 of the protocol. Attributes: socket."""

    def __init__(self, host: str, timeout: float) -> None:
        """Connects; raises LinkError where that, and every `ask` after it, takes longer than `timeout` [s] altogether."""
        self._reader = PacketReader()
        self._end = time.monotonic() + timeout
        try:
            self.socket = socket.create_connection((host, RTDE), timeout)
        except OSError as error:
            raise LinkError(f"{host} port {RTDE}: {error.strerror or error}") from None
        try:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if not self.ask(PacketType.PROTOCOL_VERSION, struct.pack(">H", PROTOCOL))[:1] == b"\x01":
                raise LinkError("the controller does not speak version 2 of RTDE: software 3.4 or newer is needed")
        except LinkError:
            self.socket.close()
            raise

    def ask(self, kind: PacketType, payload: bytes) -> bytes:
        """The answer to a request of the same type. Raises LinkError."""
        try:
            self.socket.settimeout(max(0.01, self._end - time.monotonic()))
            self.socket.sendall(Packet(kind, payload).encode())
            while time.monotonic() < self._end:
                for packet in self.packets(self.socket.recv(RECEIVE_SIZE)):
                    if packet.type == kind:
                        return packet.payload
        except TimeoutError:
            pass
        except OSError as error:
            raise LinkError(f"RTDE connection: {error.strerror or error}") from None
        raise LinkError(f"the controller's RTDE port accepts, but does not answer ({kind.name.lower()})")

    def packets(self, data: bytes) -> Iterator[Packet]:
        """Every packet that what was received completes. Raises LinkError where it is empty or no RTDE."""
        if not data:
            raise LinkError("the controller hung up")
        try:
            yield from self._reader.feed(data)
        except InputError as error:
            raise LinkError(str(error)) from None

    def hang_up(self) -> None:
        """Wakes whoever waits for data on another thread; harmless when the other side was first."""
        with suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.socket.close()


def commanded_by_another(host: str, timeout: float) -> bool:
    """Whether another client holds the registers that commands go through; found out without disturbing it.

    Raises:
        LinkError: nobody answers within `timeout` [s].
    """
    talk = RtdeTalk(host, timeout)
    try:
        return b"IN_USE" in talk.ask(PacketType.SETUP_INPUTS, COMMAND_REGISTER.encode())
    finally:
        talk.close()  # which gives the register back
