"""Packets of protocol DYNAMIXEL 2.0, compared with the examples of the e-Manual."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import dynamixel as codec


def test_packets_are_those_of_the_examples_in_the_manual():
    ping = codec.packet(1, 0x01, b"")
    assert ping == bytes.fromhex("ff ff fd 00 01 03 00 01 19 4e")
    # Read the present position (132, 4 bytes) of the servo 1.
    assert codec.read(1, 132, 4) == bytes.fromhex("ff ff fd 00 01 07 00 02 84 00 04 00 1d 15")
    # Write 512 to the goal position (116) of the servo 1.
    assert codec.write(1, 116, bytes.fromhex("00 02 00 00")) == bytes.fromhex(
        "ff ff fd 00 01 09 00 03 74 00 00 02 00 00 ca 89"
    )


def test_the_answer_of_the_manual_is_found():
    status = bytes.fromhex("ff ff fd 00 01 08 00 55 00 a6 00 00 00 8c c0")
    found = codec.find(b"\x00\xff" + status + b"\xff\xff")
    assert found.packets == [(1, bytes.fromhex("55 00 a6 00 00 00"))]
    assert not found.rejected
    assert found.rest.endswith(b"\xff\xff")


@given(
    st.lists(st.sampled_from([b"\xff", b"\xfd", b"\x00", b"\xff\xff\xfd", b"a"]), max_size=30),
    st.integers(0, 252),
)
def test_any_data_are_found_again(parts, identifier):
    data = b"".join(parts)
    found = codec.find(codec.packet(identifier, codec.STATUS, data))
    assert found.packets == [(identifier, bytes((codec.STATUS,)) + data)]
    assert b"\xff\xff\xfd\x00" not in codec.packet(identifier, codec.STATUS, data)[4:]


@given(st.integers(0, 200), st.integers(1, 255))
def test_a_changed_byte_is_rejected(place, change):
    packet = bytearray(codec.packet(1, codec.STATUS, bytes(12)))
    packet[place % (len(packet) - 7) + 7] ^= change
    assert codec.find(bytes(packet)).packets == []


@given(st.binary(max_size=100), st.integers(0, 100))
def test_a_packet_that_arrives_in_two_parts_is_found(noise, cut):
    packet = codec.packet(7, codec.STATUS, b"\0abc")
    data = noise.replace(b"\xff", b"") + packet
    first = codec.find(data[:cut])
    second = codec.find(first.rest + data[cut:])
    assert first.packets + second.packets == [(7, b"\x55\0abc")]


def test_conditions_and_motions_are_decoded():
    data = bytearray(35)
    data[0], data[6], data[34] = 1, 0x20, 0xFF
    assert codec.condition(bytes(data)) == (True, 0x20, -1)
    assert codec.motion(bytes.fromhex("9cff feffffff 00080000")) == (-100, -2, 2048)


@pytest.mark.parametrize("address", [0, 64, 126])
def test_a_silent_write_is_a_sync_write_for_one_servo(address):
    found = codec.find(codec.silent_write(5, address, b"\1\2")).packets
    assert found == [(0xFE, bytes((0x83, address, 0, 2, 0, 5, 1, 2)))]
