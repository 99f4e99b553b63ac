"""Checksums compared with published check values and with a bitwise computation."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.framing.crc import crc16_modbus, crc16_x25

CHECK = b"123456789"


@pytest.mark.parametrize(
    ("crc", "check", "empty"), [(crc16_x25, 0x906E, 0x0000), (crc16_modbus, 0x4B37, 0xFFFF)]
)
def test_check_values_of_the_catalogue(crc, check, empty):
    assert crc(CHECK) == check
    assert crc(b"") == empty


def test_modbus_of_a_request_in_the_field():
    assert crc16_modbus(bytes.fromhex("01 03 00 00 00 0a")).to_bytes(2, "little") == b"\xc5\xcd"


def test_x25_leaves_its_residue_on_a_frame_that_is_intact():
    framed = CHECK + crc16_x25(CHECK).to_bytes(2, "little")
    assert crc16_x25(framed) ^ 0xFFFF == 0xF0B8


def division(data: bytes, polynomial: int, mask: int) -> int:
    """Return the remainder, computed bit by bit, least significant bit first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ polynomial * (crc & 1)
    return crc ^ mask


@given(st.binary(max_size=80))
def test_both_are_the_remainders_of_their_polynomials(data):
    assert crc16_x25(data) == division(data, 0x8408, 0xFFFF)
    assert crc16_modbus(data) == division(data, 0xA001, 0)


@given(st.binary(min_size=1, max_size=60), st.data())
def test_every_burst_error_of_up_to_16_bits_is_detected(data, draw):
    burst = draw.draw(st.integers(1, 0xFFFF))
    shift = draw.draw(st.integers(0, max(8 * len(data) - 16, 0)))
    flipped = int.from_bytes(data, "little") ^ burst << shift
    if flipped >= 1 << 8 * len(data):
        return
    damaged = flipped.to_bytes(len(data), "little")
    assert crc16_x25(damaged) != crc16_x25(data)
    assert crc16_modbus(damaged) != crc16_modbus(data)
