"""RTDE packets on the wire: a header of size and type, then big-endian fields (UR RTDE guide, protocol versions 1 and 2)."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

from weldsim.errors import InputError

HEADER = struct.Struct(">HB")
MAX_SIZE = 0xFFFF  # [byte] what the header's size field can say


class PacketType(IntEnum):
    """One letter each in the guide."""

    PROTOCOL_VERSION = ord("V")
    CONTROLLER_VERSION = ord("v")
    TEXT_MESSAGE = ord("M")
    DATA = ord("U")
    SETUP_OUTPUTS = ord("O")
    SETUP_INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")


FORMATS: dict[str, str] = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}
"""`struct` code of each RTDE type."""


class ProtocolError(InputError):
    """Bytes that are no RTDE packet. `data`: size, type."""


@dataclass(frozen=True)
class Packet:
    """One packet without its header."""

    type: int
    payload: bytes

    def encode(self) -> bytes:
        """The bytes on the wire. Raises ProtocolError where the payload is longer than a header can say."""
        size = HEADER.size + len(self.payload)
        if size > MAX_SIZE:
            raise ProtocolError(f"RTDE packet of {size} bytes: at most {MAX_SIZE}", size=size, type=self.type)
        return HEADER.pack(size, self.type) + self.payload


class PacketReader:
    """Packets out of a byte stream that arrives in pieces."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[Packet]:
        """Every packet that `data` completes. Raises ProtocolError for a header that cannot be one."""
        self._buffer += data
        while len(self._buffer) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._buffer)
            if size < HEADER.size:
                raise ProtocolError(f"RTDE header says {size} bytes, less than itself; the stream is lost", size=size, type=kind)
            if len(self._buffer) < size:
                return
            payload = bytes(self._buffer[HEADER.size : size])
            del self._buffer[:size]
            yield Packet(kind, payload)


@cache
def layout(types: tuple[str, ...]) -> struct.Struct:
    """How values of these RTDE types lie one after another."""
    return struct.Struct(">" + "".join(FORMATS[name] for name in types))


def unpack_values(types: Sequence[str], payload: bytes) -> list[Any]:
    """One value for each type: a number, or a list for a vector. What is longer than the recipe is passed over.

    Raises:
        ProtocolError: a payload that is too short.
    """
    shape = layout(tuple(types))
    if shape.size > len(payload):
        raise ProtocolError(
            f"RTDE data of {len(payload)} bytes, the recipe has {shape.size}", size=len(payload), type=int(PacketType.DATA)
        )
    flat = iter(shape.unpack_from(payload))
    return [[next(flat) for _ in range(width(name))] if name.startswith("VECTOR") else next(flat) for name in types]


def width(kind: str) -> int:
    """How many numbers a value of this RTDE type has."""
    return int(kind[6]) if kind.startswith("VECTOR") else 1
