"""The ur_rtde client library, imported here and nowhere else, and only when asked for.

Its constructors hold the interpreter, wait without end for a controller that accepts and says nothing, and its reconnection
crashes: all of this runs in a process that can be killed (`ur_client`), never in the one that plans.
"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from weldsim.errors import ExecutionError

INSTALL = "pip install ur_rtde"


@runtime_checkable
class Control(Protocol):
    """What is used of `RTDEControlInterface`."""

    def servoJ(self, q: Sequence[float], speed: float, acceleration: float, time: float, lookahead: float, gain: float) -> bool: ...
    def servoStop(self, a: float) -> bool: ...
    def setTcp(self, tcp_offset: Sequence[float]) -> bool: ...
    def setPayload(self, mass: float, cog: Sequence[float]) -> bool: ...
    def getTCPOffset(self) -> list[float]: ...
    def setWatchdog(self, min_frequency: float) -> bool: ...
    def kickWatchdog(self) -> bool: ...
    def stopScript(self) -> None: ...
    def disconnect(self) -> None: ...


@runtime_checkable
class Signals(Protocol):
    """What is used of `RTDEIOInterface`."""

    def setStandardDigitalOut(self, output_id: int, signal_level: bool) -> bool: ...
    def disconnect(self) -> None: ...


def open_control(host: str) -> Control:
    """A control client, its script uploaded and running. Blocks; raises ExecutionError where the library is missing."""
    try:
        import rtde_control  # type: ignore[import-not-found] - compiled, untyped, optional
    except ImportError as error:
        raise missing(error) from None
    return rtde_control.RTDEControlInterface(host)


def open_signals(host: str) -> Signals:
    """A client that writes outputs. Blocks; raises ExecutionError where the library is missing."""
    try:
        import rtde_io  # type: ignore[import-not-found] - compiled, untyped, optional
    except ImportError as error:
        raise missing(error) from None
    return rtde_io.RTDEIOInterface(host)


def missing(error: ImportError) -> ExecutionError:
    """The error of a machine without the library."""
    return ExecutionError(f"the UR client library cannot be loaded ({error}); {INSTALL}", rule="library")
