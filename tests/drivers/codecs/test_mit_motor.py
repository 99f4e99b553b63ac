"""Frames of motors with the MIT mode, compared with frames in the documents of the vendors."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import mit_motor as codec
from drivers.codecs.mit_motor import CUBEMARS, DAMIAO, Ranges

DM4310 = DAMIAO["DM4310"]


def test_the_fields_of_a_command_are_in_the_order_of_the_protocol():
    low = codec.command(DM4310, -12.5, -30.0, 0.0, 0.0, -10.0)
    assert low == bytes(8)
    for i, width, values in (
        (0, 16, (12.5, -30.0, 0.0, 0.0, -10.0)),
        (16, 12, (-12.5, 30.0, 0.0, 0.0, -10.0)),
        (28, 12, (-12.5, -30.0, 500.0, 0.0, -10.0)),
        (40, 12, (-12.5, -30.0, 0.0, 5.0, -10.0)),
        (52, 12, (-12.5, -30.0, 0.0, 0.0, 10.0)),
    ):
        bits = f"{int.from_bytes(codec.command(DM4310, *values), 'big'):064b}"
        assert bits == "0" * i + "1" * width + "0" * (64 - i - width)


def test_values_beyond_the_range_are_limited():
    frame = codec.command(DM4310, 100.0, -100.0, 1e4, -1.0, 1e3)
    assert frame == codec.command(DM4310, 12.5, -30.0, 500.0, 0.0, 10.0)


def test_the_state_of_a_damiao_motor_has_its_status_in_the_first_byte():
    # Motor 1, enabled, position 0x8000, velocity 0x7FF, torque 0x800, temperatures.
    state = codec.state("damiao", DM4310, bytes.fromhex("11 80 00 7f f8 00 23 1e"))
    assert state[:3] == (1, 1, 0x8000)
    assert state.velocity == pytest.approx(-30.0 / 4095)
    assert state.torque == pytest.approx(10.0 / 4095)


def test_the_state_of_another_motor_has_its_identifier_first_and_its_error_last():
    state = codec.state("cubemars", CUBEMARS["AK80-9"], bytes.fromhex("17 ff ff ff f0 00 19 02"))
    assert state == (0x17, 2, 0xFFFF, 50.0, -18.0)


def test_registers_are_read_with_the_identifier_of_the_motor():
    assert codec.read_register(0x0B, codec.PMAX) == bytes.fromhex("0b 00 33 15 00 00 00 00")
    assert codec.refresh(0x0B) == bytes.fromhex("0b 00 cc 00 00 00 00 00")
    answer = bytes.fromhex("0b 00 33 15 00 00 48 41")
    assert codec.register_value(0x0B, codec.PMAX, answer) == 12.5
    assert codec.register_value(0x0B, codec.VMAX, answer) is None
    assert codec.register_value(0x0A, codec.PMAX, answer) is None
    timeout = bytes.fromhex("0b 00 33 09 e8 03 00 00")
    assert codec.register_value(0x0B, codec.TIMEOUT, timeout) == 1000


@given(value=st.floats(-40.0, 40.0))
def test_a_velocity_is_rounded_by_at_most_half_a_count(value):
    found = codec.rounded(value, -30.0, 30.0, codec.OTHER_BITS)
    assert abs(found - min(max(value, -30.0), 30.0)) <= 30.0 / 4095 * (1 + 1e-9)


def test_the_gains_zero_are_exact():
    assert codec.rounded(0.0, 0.0, codec.MOST_STIFFNESS, codec.OTHER_BITS) == 0.0


def test_the_models_have_ranges_that_are_positive():
    for ranges in (*DAMIAO.values(), *CUBEMARS.values()):
        assert isinstance(ranges, Ranges)
        assert all(value > 0.0 and math.isfinite(value) for value in ranges)
