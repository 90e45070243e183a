"""RTDE on the wire: whatever is packed can be unpacked, in whatever pieces it comes."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weldsim.controller.inputs import InputRecipe
from weldsim.controller.registers import Registers
from weldsim.execution.rtde_packet import HEADER, Packet, PacketReader, ProtocolError, layout, unpack_values, width

NUMBER = {
    "BOOL": st.booleans(),
    "UINT8": st.integers(0, 255),
    "UINT32": st.integers(0, 2**32 - 1),
    "UINT64": st.integers(0, 2**64 - 1),
    "INT32": st.integers(-(2**31), 2**31 - 1),
    "DOUBLE": st.floats(allow_nan=False),
    "VECTOR3D": st.floats(allow_nan=False),
    "VECTOR6D": st.floats(allow_nan=False),
    "VECTOR6INT32": st.integers(-(2**31), 2**31 - 1),
    "VECTOR6UINT32": st.integers(0, 2**32 - 1),
}


@st.composite
def recipes(draw: st.DrawFn) -> tuple[list[str], list]:
    types = draw(st.lists(st.sampled_from(sorted(NUMBER)), min_size=1, max_size=8))
    values = [
        draw(NUMBER[kind]) if width(kind) == 1 else draw(st.lists(NUMBER[kind], min_size=width(kind), max_size=width(kind)))
        for kind in types
    ]
    return types, values


@given(recipes())
def test_values_survive_the_wire(recipe):
    types, values = recipe
    flat = [number for value in values for number in (value if isinstance(value, list) else [value])]
    assert unpack_values(types, layout(tuple(types)).pack(*flat)) == values


@given(recipes())
def test_data_that_is_too_short_is_refused(recipe):
    types, _ = recipe
    with pytest.raises(ProtocolError, match="the recipe has"):
        unpack_values(types, bytes(layout(tuple(types)).size - 1))


@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=60)), max_size=8), st.lists(st.integers(1, 40), min_size=1))
def test_packets_survive_being_cut_anywhere(messages, cuts):
    packets = [Packet(*message) for message in messages]
    stream, reader, found, k = b"".join(packet.encode() for packet in packets), PacketReader(), [], 0
    while stream:
        size = cuts[k % len(cuts)]
        found += reader.feed(stream[:size])
        stream, k = stream[size:], k + 1
    assert found == packets


@given(st.integers(0, HEADER.size - 1), st.integers(0, 255))
def test_header_that_cannot_be_one_is_refused(size, kind):
    with pytest.raises(ProtocolError, match="less than itself"):
        list(PacketReader().feed(struct.pack(">HB", size, kind)))


def test_packet_longer_than_a_header_can_say_is_refused():
    with pytest.raises(ProtocolError, match="at most"):
        Packet(0, bytes(70_000)).encode()


@given(st.integers(0, 47), st.integers(-(2**31), 2**31 - 1), st.integers(0, 47), st.floats(allow_nan=False))
def test_registers_hold_what_was_written(i, whole, j, real):
    recipe, io = InputRecipe([f"input_int_register_{i}", f"input_double_register_{j}"], set()), Registers()
    recipe.apply(struct.pack(">id", whole, real), io)
    assert (io.in_int[i], io.in_double[j]) == (whole, real)
    assert sum(map(bool, io.in_int)) == bool(whole)


@given(st.integers(0, 255), st.integers(0, 255), st.integers(0, 2**18 - 1))
def test_masked_outputs_change_and_the_others_stay(mask, value, before):
    recipe, io = InputRecipe(["standard_digital_output_mask", "standard_digital_output"], set()), Registers(digital_out=before)
    recipe.apply(bytes([mask, value]), io)
    assert io.digital_out & mask == value & mask
    assert io.digital_out & ~mask == before & ~mask
