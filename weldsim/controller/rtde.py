"""The RTDE interface, port 30004: what one client sets up, writes and is sent."""

import struct
from collections.abc import Iterator

from weldsim.controller.inputs import InputRecipe
from weldsim.controller.machine import Machine
from weldsim.controller.outputs import OutputRecipe
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType, ProtocolError

VERSIONS = (1, 2)
MAX_RECIPES = 255


class Claims:
    """Which client holds which input: two cannot write the same one."""

    def __init__(self) -> None:
        self._held: dict[str, object] = {}

    def others(self, client: object) -> set[str]:
        """Inputs that somebody else holds."""
        return {name for name, holder in self._held.items() if holder is not client}

    def hold(self, client: object, names: tuple[str, ...]) -> None:
        """From now on they are the client's."""
        self._held.update(dict.fromkeys(names, client))

    def release(self, client: object) -> None:
        """The client has gone."""
        self._held = {name: holder for name, holder in self._held.items() if holder is not client}


class RtdeSession:
    """One client.

    Attributes:
        started: whether it is sent data.  finished: whether its stream made no sense and it must be hung up on.
    """

    def __init__(self, machine: Machine, claims: Claims) -> None:
        self._machine, self._claims = machine, claims
        self._reader = PacketReader()
        self._version = 1
        self._outputs: dict[int, OutputRecipe] = {}
        self._inputs: dict[int, InputRecipe] = {}
        self._cycle = 0
        self.started = self.finished = False

    def greeting(self) -> bytes:
        return b""

    def ended(self) -> None:
        self._claims.release(self)

    def received(self, data: bytes) -> bytes:
        """Answers to every packet that is complete."""
        try:
            return b"".join(answer.encode() for packet in self._reader.feed(data) for answer in self._answer(packet))
        except ProtocolError as error:
            self._machine.say(f"RTDE client hung up on: {error}")
            self.finished = True
            return b""

    def data(self) -> bytes:
        """The packets that are due after one more control period."""
        if not self.started:
            return b""
        self._cycle += 1
        snapshot = self._machine.snapshot
        due = ((number, recipe) for number, recipe in self._outputs.items() if self._cycle % recipe.every == 0)
        return b"".join(
            Packet(PacketType.DATA, (bytes([number]) if self._version > 1 else b"") + recipe.pack(snapshot)).encode()
            for number, recipe in due
        )

    def _answer(self, packet: Packet) -> Iterator[Packet]:
        kind, payload = packet.type, packet.payload
        if kind == PacketType.DATA:
            self._write(payload)
        elif kind == PacketType.PROTOCOL_VERSION:
            asked = int.from_bytes(payload[:2], "big")
            accepted = asked in VERSIONS
            if accepted:
                self._version = asked
            yield Packet(kind, bytes([accepted]))
        elif kind == PacketType.CONTROLLER_VERSION:
            yield Packet(kind, struct.pack(">4I", *self._machine.profile.version))
        elif kind == PacketType.SETUP_OUTPUTS:
            yield Packet(kind, self._set_up_outputs(payload))
        elif kind == PacketType.SETUP_INPUTS:
            yield Packet(kind, self._set_up_inputs(payload))
        elif kind == PacketType.START:
            self.started = bool(self._outputs) and all(recipe.complete for recipe in self._outputs.values())
            yield Packet(kind, bytes([self.started]))
        elif kind == PacketType.PAUSE:
            self.started = False
            yield Packet(kind, b"\x01")
        elif kind == PacketType.TEXT_MESSAGE:
            self._machine.say(f"RTDE client: {payload[1 : 1 + payload[0]].decode(errors='replace') if payload else ''}")

    def _write(self, payload: bytes) -> None:
        """Apply one packet of inputs; one for a recipe that was refused, or that is too short for its recipe, is passed over.

        ur_rtde sends FK with a TCP of zeros by a recipe that is shorter than what it sends: the rest must not matter. Its
        setExternalForceTorque sends less than its recipe has: nothing to hang up for.
        """
        recipe = self._inputs.get(payload[0]) if payload else None
        if recipe is None:
            return
        try:
            recipe.apply(payload[1:], self._machine.io)
        except ProtocolError as error:
            self._machine.say(f"RTDE input passed over: {error}")
            return
        self._machine.written(recipe.names)

    def _set_up_outputs(self, payload: bytes) -> bytes:
        frequency = self._machine.profile.frequency
        if self._version > 1:
            if len(payload) < 8:
                raise ProtocolError("RTDE output set-up without a frequency", size=len(payload), type=int(PacketType.SETUP_OUTPUTS))
            (frequency,), payload = struct.unpack(">d", payload[:8]), payload[8:]
        recipe = OutputRecipe(_names(payload), frequency, self._machine.profile)
        types = ",".join(recipe.types).encode()
        if self._version == 1:
            self._outputs = {0: recipe}
            return types
        number = len(self._outputs) + 1 if recipe.complete and len(self._outputs) < MAX_RECIPES else 0
        if number:
            self._outputs[number] = recipe
        return bytes([number]) + types

    def _set_up_inputs(self, payload: bytes) -> bytes:
        recipe = InputRecipe(_names(payload), self._claims.others(self))
        number = len(self._inputs) + 1 if recipe.complete and len(self._inputs) < MAX_RECIPES else 0
        if number:
            self._inputs[number] = recipe
            self._claims.hold(self, recipe.names)
        return bytes([number]) + ",".join(recipe.types).encode()


def _names(payload: bytes) -> list[str]:
    """Variable names of a set-up packet; a comma may close the list."""
    return [name for name in payload.decode(errors="replace").split(",") if name]
