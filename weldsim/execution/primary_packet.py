"""Messages of UR's primary client interface on the wire, big-endian: a size and a type, then the rest.

Layout: 'Primary and Secondary Interfaces' in the manufacturer's documentation of the client interfaces (software 5.9 to 5.23;
its older editions cover CB3). A message is its whole size (int32), its type (uint8) and its contents; those of a robot state,
type 16, are sub-packages that begin alike. Sub-package 5, 'Kinematics info', holds a checksum of each joint (uint32), then theta,
a, d and alpha (double), six of each, then the calibration status. Its order and its length of 225 bytes were checked with a
message of the manufacturer's simulator that stands in the tests of its Universal_Robots_Client_Library. That library says that
the page has the status as one byte where four are sent: both are taken, and no other length.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import InputError

HEADER = struct.Struct(">iB")
ROBOT_STATE, ROBOT_MESSAGE = 16, 20  # types of messages
MODE_DATA, KINEMATICS_INFO = 0, 5  # types of sub-packages of a robot state
MAX_SIZE = 1 << 20  # [byte] no message of a controller is that long; states have about 1400
_ARM = struct.Struct(">6I24d")
_STATUS = {1: ">B", 4: ">I"}
FURTHEST, WIDEST = 1e4, 100.0  # [m], [rad] calibrated lengths of parallel joints trade off by hundreds of metres, not by more


class PrimaryError(InputError):
    """Bytes that are no message of a primary client interface. `data`: none."""


@dataclass(frozen=True, eq=False)
class KinematicsInfo:
    """What sub-package 5 tells of an arm.

    Attributes:
        dh: (6, 4) theta offset [rad], a [m], d [m], alpha [rad] of each joint.
        status: 0 not initialised, 1 not linearised, 2 linearised: as the controller's own calibration file explains its entry
            of the same name; that this is the same number is inferred.
        checksums: of the six joints.
    """

    dh: Float[ndarray, "6 4"]
    status: int
    checksums: tuple[int, ...] = (0xFFFFFFFF,) * 6

    def encode(self) -> bytes:
        """The contents of the sub-package."""
        return _ARM.pack(*self.checksums, *self.dh.T.ravel()) + struct.pack(_STATUS[4], self.status)

    @staticmethod
    def decode(contents: bytes) -> "KinematicsInfo":
        """Raises PrimaryError for another length, and for figures that no arm has."""
        form = _STATUS.get(len(contents) - _ARM.size)
        if form is None:
            raise PrimaryError(f"kinematics info of {len(contents)} bytes, expected {_ARM.size} and 1 or 4")
        values = _ARM.unpack_from(contents)
        dh = np.array(values[6:]).reshape(4, 6).T
        if not (np.abs(dh[:, 1:3]).max() <= FURTHEST and np.abs(dh[:, [0, 3]]).max() <= WIDEST):
            raise PrimaryError(f"kinematics info: figures beyond {FURTHEST:g} m or {WIDEST:g} rad, or none")
        (status,) = struct.unpack_from(form, contents, _ARM.size)
        return KinematicsInfo(dh, status, values[:6])


def framed(kind: int, contents: bytes) -> bytes:
    """A message, or a sub-package, with its header."""
    return HEADER.pack(HEADER.size + len(contents), kind) + contents


def sub_packages(contents: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and contents of each sub-package of a robot state. Raises PrimaryError where they do not fill it exactly."""
    at = 0
    while at < len(contents):
        if len(contents) - at < HEADER.size:
            raise PrimaryError(f"robot state: {len(contents) - at} bytes left over")
        size, kind = HEADER.unpack_from(contents, at)
        if not HEADER.size <= size <= len(contents) - at:
            raise PrimaryError(f"robot state: sub-package {kind} of {size} bytes where {len(contents) - at} are left")
        yield kind, contents[at + HEADER.size : at + size]
        at += size


def kinematics_in(contents: bytes) -> KinematicsInfo | None:
    """What a robot state tells of the arm, None where it does not. Raises PrimaryError for one that cannot be."""
    found = [body for kind, body in sub_packages(contents) if kind == KINEMATICS_INFO]
    if len(found) > 1:
        raise PrimaryError(f"robot state: kinematics info {len(found)} times")
    return KinematicsInfo.decode(found[0]) if found else None


class MessageReader:
    """Messages out of a byte stream that arrives in pieces."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Type and contents of every message that `data` completes. Raises PrimaryError for a header that cannot be one."""
        self._buffer += data
        while len(self._buffer) >= HEADER.size:
            size, kind = HEADER.unpack_from(self._buffer)
            if not HEADER.size <= size <= MAX_SIZE:
                raise PrimaryError(f"message of {size} bytes: {HEADER.size} to {MAX_SIZE}; the stream is lost")
            if len(self._buffer) < size:
                return
            contents = bytes(self._buffer[HEADER.size : size])
            del self._buffer[:size]
            yield kind, contents
