from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs.moteus import (
    FD_LENGTHS,
    IDENTIFY,
    QUERY,
    READ_FIRMWARE,
    READ_MAP_VERSION,
    READ_MODEL,
    decode,
    fault_text,
    identifier,
    padded,
    serial_text,
    stop,
    torque,
    velocity,
    version_text,
)

NAN = "0000c07f"


def test_commands_are_those_of_the_vendors_library():
    """Frames of `make_position` and `make_stop` of moteus 1.1.1, without their queries."""
    expected = f"01000a0e20{NAN}000000400d250000003f0f27cdcc4c3d000080bf000080bf"
    assert velocity(2.0, 0.5, 0.05) == padded(bytes.fromhex(expected) + QUERY)
    expected = f"01000a0c0620{NAN}000000000000803e00000000000000000000003f0d27cdcc4c3d0d2b00000000"
    assert torque(0.25, 0.5, 0.05) == padded(bytes.fromhex(expected) + QUERY)
    assert stop(b"") == padded(bytes.fromhex("010000") + QUERY)
    assert IDENTIFY.hex() == "1b80021ba002"


def test_the_frame_that_reads_is_that_of_the_documentation():
    assert bytes.fromhex("1100110f") == QUERY[:2] + QUERY[4:]
    assert QUERY[2:4] == bytes.fromhex("1f01")
    assert [data.hex() for data in (READ_MODEL, READ_FIRMWARE, READ_MAP_VERSION)] == [
        "198002",
        "198102",
        "198202",
    ]


def test_identifiers_are_those_of_the_documentation():
    assert identifier(0, 1, reply=True) == 0x8001
    assert identifier(1, 0) == 0x100


@pytest.mark.parametrize("command", [velocity(1.0, 1.0, 0.1), torque(1.0, 1.0, 0.1), stop(b"")])
def test_frames_have_a_length_of_can_fd(command):
    assert len(command) in FD_LENGTHS
    assert len(command) <= 48


def test_the_reply_of_the_documentation_is_decoded():
    reply = decode(bytes.fromhex("2404000a005000000170ff230d181400"))
    assert reply.values == {0: 10, 1: 80, 2: 256, 3: -144, 13: 24, 14: 20, 15: 0}
    assert reply.refused == ()


def test_floats_padding_and_refused_registers_are_decoded():
    data = b"\x21\x00\x0a\x2f\x01" + struct.pack("<3f", 1.5, -2.0, 0.25) + b"\x30\x2b\x01PPP"
    assert decode(data) == ({0: 10, 1: 1.5, 2: -2.0, 3: 0.25}, (0x2B,))


def test_a_register_of_two_bytes_is_decoded():
    assert decode(bytes.fromhex("29820205000000")).values == {0x102: 5}


@pytest.mark.parametrize("data", ["2f01", "2100", "01000a", "60", "21ffffffffff00", "2f01000000"])
def test_malformed_frames_are_refused(data):
    assert decode(bytes.fromhex(data)) is None


@given(st.binary(max_size=64))
def test_any_bytes_are_decoded_or_refused(data):
    decode(data)


def test_texts():
    assert version_text(0x010304) == "1.3.4"
    assert fault_text(1, 35) == "encoder fault"
    assert fault_text(1, 99) == "fault 99"
    assert fault_text(11, 0) == "its watchdog has expired"
    assert fault_text(10, 102) == ""  # the torque is limited


def test_a_serial_number_is_shown_as_the_vendors_tool_shows_it():
    """The expected text is that of moteus_tool._base64_serial_number."""
    assert serial_text((0x3A1B, 0x2C5D, 0x77)) == "AAA6GwAALF0AAAB3"
