"""Codec of CiA 402, compared with the tables of canopen, and its properties."""

from __future__ import annotations

import math
import struct

import pytest
from canopen.emcy import EMCY_STRUCT
from canopen.nmt import NMT_COMMANDS, NMT_STATES
from canopen.profiles.p402 import State402
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs import cia402
from drivers.codecs.cia402 import (
    TOWARDS_OPERATION,
    Control,
    DriveState,
    NmtCommand,
    NmtState,
    Units,
)

UNITS = Units(10_000, 5e-3, "counts_per_s", rated_torque=0.5)


@given(st.integers(0, 0xFFFF))
def test_the_state_of_a_statusword_is_the_same_as_in_canopen(word):
    theirs = {name for name, (mask, bits) in State402.SW_MASK.items() if word & mask == bits}
    ours = cia402.state_of(word)
    assert theirs == ({ours.words.upper()} if ours else set())


def test_each_step_towards_operation_is_the_one_of_canopen_s_transition_table():
    state = DriveState.SWITCH_ON_DISABLED
    steps = (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED)
    for following in steps:
        transition = (state.words.upper(), following.words.upper())
        assert State402.TRANSITIONTABLE[transition] == TOWARDS_OPERATION[state]
        state = following
    assert TOWARDS_OPERATION[DriveState.FAULT] == State402.CW_SWITCH_ON_DISABLED
    assert Control.QUICK_STOP == State402.CW_QUICK_STOP


def test_no_command_but_a_reset_is_given_in_a_fault_and_none_while_the_drive_reacts_to_it():
    assert TOWARDS_OPERATION[DriveState.FAULT] is Control.FAULT_RESET
    assert DriveState.FAULT_REACTION_ACTIVE not in TOWARDS_OPERATION
    assert DriveState.QUICK_STOP_ACTIVE not in TOWARDS_OPERATION


def test_nmt_speaks_as_canopen_does():
    assert NMT_COMMANDS["OPERATIONAL"] == NmtCommand.START
    assert NMT_COMMANDS["PRE-OPERATIONAL"] == NmtCommand.ENTER_PRE_OPERATIONAL
    assert NMT_COMMANDS["RESET COMMUNICATION"] == NmtCommand.RESET_COMMUNICATION
    for state in NmtState:
        if state is not NmtState.BOOT_UP:
            assert NMT_STATES[state] == state.words.upper()


def test_identifiers_are_those_of_the_predefined_connection_set():
    assert (cia402.SYNC, cia402.EMCY, cia402.TPDO1, cia402.RPDO1) == (0x80, 0x80, 0x180, 0x200)
    assert (cia402.TPDO2, cia402.SDO_ANSWER, cia402.HEARTBEAT) == (0x280, 0x580, 0x700)
    assert cia402.NMT == 0


def test_a_command_is_the_controlword_then_the_target_least_significant_byte_first():
    assert cia402.command(Control.ENABLE_OPERATION, -2) == bytes.fromhex("0f00feffffff")


def test_counts_and_thousandths_of_rated_torque_become_metres_and_newtons():
    assert UNITS.position(struct.pack("<Hi", 0, 20_000)) == pytest.approx(10e-3)
    velocity, force = UNITS.velocity_and_force(struct.pack("<ih", -10_000, 100))
    assert velocity == pytest.approx(-5e-3)
    assert force == pytest.approx(0.1 * 0.5 * 2 * math.pi / 5e-3)


def test_one_rpm_is_a_sixtieth_of_the_travel_per_second():
    rpm = Units(10_000, 6e-3, "rpm")
    assert rpm.target(0.1e-3) == 1
    assert rpm.velocity_and_force(struct.pack("<ih", 60, 0))[0] == pytest.approx(6e-3)


def test_without_a_rated_torque_the_force_is_unknown():
    units = Units(10_000, 5e-3, "counts_per_s")
    assert math.isnan(units.velocity_and_force(bytes(6))[1])


@given(st.floats(-10, 10), st.sampled_from(["counts_per_s", "rpm"]))
def test_a_target_is_the_nearest_unit(velocity, unit):
    units = Units(4096, 2e-3, unit)
    applied = units.target(velocity) * units.metres_per_second
    assert abs(applied - velocity) <= 0.5000001 * units.metres_per_second


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_any_finite_velocity_can_be_encoded(velocity):
    cia402.command(Control.ENABLE_OPERATION, UNITS.target(velocity))


@given(st.integers(0, 0xFFFF), st.integers(0, 255), st.binary(min_size=5, max_size=5))
def test_every_emergency_has_a_text_and_its_end_has_none(code, register, more):
    text = cia402.emergency(EMCY_STRUCT.pack(code, register, more))
    assert bool(text) == (code >= 0x100)
    assert not text or f"{code:04X}h" in text


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x8130, "the controller's heartbeat was missed"),
        (0x8250, "the controller's PDO was missed"),
        (0x2311, "continuous over-current at the output"),
        (0x3299, "voltage"),
        (0xA000, "unknown error"),
    ],
)
def test_an_emergency_is_reported_by_its_code_or_its_group(code, words):
    assert cia402.emergency(EMCY_STRUCT.pack(code, 0, bytes(5))).startswith(words)


@pytest.mark.parametrize(
    ("mode", "data"),
    [("csv", "0f 00 e8 03 00 00"), ("csp", "0f 00 e8 03 00 00"), ("cst", "0f 00 e8 03")],
)
def test_the_target_torque_has_two_bytes(mode, data):
    found = cia402.command(Control.ENABLE_OPERATION, 1000, mode)
    assert found == bytes.fromhex(data)


def test_targets_are_in_the_units_of_the_drive():
    assert UNITS.target_position(-5e-3) == -10_000
    assert UNITS.newtons == pytest.approx(1e-3 * 0.5 * 2.0 * math.pi / 5e-3)
    assert UNITS.target_torque(100.0 * UNITS.newtons, 2000) == 100
    assert UNITS.target_torque(-1e6, 2000) == -2000
    milli = Units(10_000, 5e-3, "milli_rpm")
    assert milli.target(5e-3) == 60_000  # a turn per second
