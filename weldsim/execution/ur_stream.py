"""What a UR controller reports, every control period, over RTDE: each packet read in order, none waited for without end.

Spoken directly (UR RTDE guide, protocol version 2) rather than through the client library: that one shows the newest packet
only, so a reader that is late loses some, and its constructor waits for ever, holding the interpreter, for a controller that
accepts and says nothing.
"""

import struct
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

from weldsim.execution.priority import hurry
from weldsim.execution.rtde_packet import Packet, PacketType, layout, width
from weldsim.execution.rtde_talk import RECEIVE_SIZE, LinkError, RtdeTalk

READ_TIMEOUT = 0.5  # [s]
KEPT = 2000  # samples that nobody has taken: 4 s at 500 Hz
NEEDED: dict[str, str] = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "target_q": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_digital_output_bits": "UINT64",
    "robot_mode": "INT32",
    "safety_mode": "INT32",
    "runtime_state": "UINT32",
    "output_int_register_0": "INT32",
}
WELCOME: dict[str, str] = {
    "safety_status_bits": "UINT32",  # 3.10 and 5.4
    "tcp_offset": "VECTOR6D",
    "payload": "DOUBLE",  # 3.11
    "payload_cog": "VECTOR3D",
    "actual_current_as_torque": "VECTOR6D",  # 5.23
}
"""Variables that older controllers do not have."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One packet.

    Attributes:
        arrived: host's monotonic time [s].  timestamp: the controller's [s].
        actual_q, actual_qd, target_q: six each [rad], [rad/s].  actual_TCP_pose: X_BT as a pose [m, rad].
        actual_digital_output_bits: bit k is standard output k.
        robot_mode, safety_mode, runtime_state, safety_status_bits: as the RTDE guide numbers them.
        output_int_register_0: 1 where ur_rtde's script waits for a command.
        tcp_offset: X_FT as a pose.  payload [kg], payload_cog [m].  actual_current_as_torque [Nm]; None where unknown.
    """

    arrived: float
    timestamp: float
    actual_q: list[float]
    actual_qd: list[float]
    target_q: list[float]
    actual_TCP_pose: list[float]
    actual_digital_output_bits: int
    robot_mode: int
    safety_mode: int
    runtime_state: int
    output_int_register_0: int
    safety_status_bits: int = 0
    tcp_offset: list[float] | None = None
    payload: float | None = None
    payload_cog: list[float] | None = None
    actual_current_as_torque: list[float] | None = None


class StateStream:
    """A connection that delivers samples.

    Attributes:
        version: of the controller: major, minor, bugfix, build.  frequency: of control [Hz].
    """

    def __init__(self, host: str, timeout: float) -> None:
        """Connects, and asks for every control period; raises LinkError where that takes longer than `timeout` [s]."""
        self._waiting: deque[Sample] = deque(maxlen=KEPT)
        self._loss, self._closing = "", False
        self._news = threading.Condition()
        self._talk = RtdeTalk(host, timeout)
        try:
            self._set_up()
        except LinkError:
            self._talk.close()
            raise
        # Always read: a controller hangs up on who does not keep up, and the newest state must not lie behind old ones.
        self._thread = threading.Thread(target=self._read, name=f"RTDE {host}", daemon=True)
        self._thread.start()

    def _set_up(self) -> None:
        self.version = struct.unpack_from(">4I", self._talk.ask(PacketType.CONTROLLER_VERSION, b"").ljust(16, b"\0"))
        self.frequency = 125.0 if self.version[0] <= 3 else 500.0
        names = {**NEEDED, **WELCOME}
        recipe, found = self._request(names)
        if lacking := [name for name, kind in NEEDED.items() if found.get(name) != kind]:
            raise LinkError(f"the controller does not report {', '.join(lacking)}; its software is too old")
        if found != names:
            names = {name: kind for name, kind in names.items() if found.get(name) == kind}
            recipe, _ = self._request(names)
        self._recipe = recipe
        self._names = tuple((name, width(kind)) for name, kind in names.items())
        self._layout = layout(tuple(names.values()))
        if self._talk.ask(PacketType.START, b"")[:1] != b"\x01":
            raise LinkError("the controller does not start its stream of states")
        self._talk.socket.settimeout(READ_TIMEOUT)

    def _request(self, names: dict[str, str]) -> tuple[int, dict[str, str]]:
        """Number of the recipe that would report these, and the type that the controller gives each."""
        wanted = struct.pack(">d", self.frequency) + ",".join(names).encode()
        answer = self._talk.ask(PacketType.SETUP_OUTPUTS, wanted)
        return answer[0], dict(zip(names, answer[1:].decode(errors="replace").split(","), strict=False))

    def _read(self) -> None:
        """Take what comes in, until the connection ends; the thread's body."""
        hurry()  # it sleeps but for a moment every period, and a state that lies about makes everything late
        loss = ""
        while not loss:
            try:
                data = self._talk.socket.recv(RECEIVE_SIZE)
                arrived = time.monotonic()
                samples = [self._sample(packet, arrived) for packet in self._talk.packets(data) if self._is_state(packet)]
            except TimeoutError:
                loss = "" if not self._closing else "closed"
                continue
            except OSError as error:
                loss = f"RTDE connection: {error.strerror or error}"
                continue
            except LinkError as error:
                loss = str(error)
                continue
            with self._news:
                self._waiting.extend(samples)
                self._news.notify_all()
        with self._news:
            self._loss = loss
            self._news.notify_all()

    def wait(self, seconds: float) -> bool:
        """Whether a sample waits, now or within `seconds`. Raises LinkError when none does and the connection has gone."""
        with self._news:
            self._news.wait_for(lambda: self._waiting or self._loss, max(0.0, seconds))
            if self._loss and not self._waiting:
                raise LinkError(self._loss)
            return bool(self._waiting)

    def take(self) -> Sample:
        """The oldest sample that waits; one must (`wait`)."""
        with self._news:
            return self._waiting.popleft()

    def take_all(self) -> list[Sample]:
        """Every sample that waits, in order. Raises LinkError when none does and the connection has gone."""
        with self._news:
            if self._loss and not self._waiting:
                raise LinkError(self._loss)
            samples = list(self._waiting)
            self._waiting.clear()
            return samples

    def __len__(self) -> int:
        """How many samples wait."""
        return len(self._waiting)

    def _is_state(self, packet: Packet) -> bool:
        return packet.type == PacketType.DATA and len(packet.payload) > self._layout.size and packet.payload[0] == self._recipe

    def _sample(self, packet: Packet, arrived: float) -> Sample:
        flat = iter(self._layout.unpack_from(packet.payload, 1))
        values: dict[str, Any] = {name: next(flat) if n == 1 else [next(flat) for _ in range(n)] for name, n in self._names}
        return Sample(arrived=arrived, **values)

    def close(self) -> None:
        """Hang up; harmless when that has happened."""
        self._closing = True
        self._talk.hang_up()  # wakes the reading thread
        self._thread.join(READ_TIMEOUT * 2)
        self._talk.close()
