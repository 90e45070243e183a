"""A record of what a controller reports, every period of it, however late this process comes to read it."""

import struct
import threading
from collections.abc import Callable
from typing import Any

from tests.controllers import PATIENCE, wait_for
from weldsim.controller.ask import ask
from weldsim.execution.rtde_packet import PacketType, unpack_values
from weldsim.execution.rtde_talk import RECEIVE_SIZE, LinkError, RtdeTalk

EVERY_PERIOD = 1e3  # [Hz] faster than any controller


class Recorder:
    """A connection that is read to the end of a `with` block.

    Attributes:
        rows: a list each, of the time [s] and the values of the variables asked for.
    """

    def __init__(self, host: str, variables: dict[str, str]) -> None:
        self.rows: list[list[Any]] = []
        self._host, names = host, {"timestamp": "DOUBLE"} | variables
        self._types = list(names.values())
        self._talk = RtdeTalk(host, PATIENCE)
        self._talk.ask(PacketType.SETUP_OUTPUTS, struct.pack(">d", EVERY_PERIOD) + ",".join(names).encode())
        self._talk.ask(PacketType.START, b"")
        self._talk.socket.settimeout(None)
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        try:
            while True:
                for packet in self._talk.packets(self._talk.socket.recv(RECEIVE_SIZE)):
                    if packet.type == PacketType.DATA:
                        self.rows.append(unpack_values(self._types, packet.payload[1:]))
        except (LinkError, OSError):
            return  # hung up

    def during(self, call: Callable[[], Any]) -> tuple[Any, list[list[Any]]]:
        """What a call answered, and the rows from its beginning to its end."""
        began = self.now()
        answer = call()
        ended = self.now()
        assert wait_for(lambda: self.rows and self.rows[-1][0] > ended)
        return answer, [row for row in self.rows if began <= row[0] <= ended]

    def now(self) -> float:
        """The controller's time [s]."""
        return float(ask(self._host, {"status": True})["t"])

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, *_: object) -> None:
        self._talk.hang_up()
        self._thread.join()
        self._talk.close()
