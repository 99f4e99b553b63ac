"""The emulated motor with the MIT mode, with frames written out by hand."""

from __future__ import annotations

import math

import can
import pytest

from drivers.devices.mit_motor_settings import MitMotorSettings
from sim_backend.wire.devices.mit_motor import EmulatedMitMotor
from sim_backend.wire.emulated_device import Mount

ENTER, EXIT, CLEAR = (b"\xff" * 7 + bytes((last,)) for last in (0xFC, 0xFD, 0xFB))
STILL = bytes.fromhex("80 00 80 00 00 00 07 ff")
"""Command without gains, of the smallest negative torque."""


class Shaft(Mount):
    def __init__(self):
        self.readings = {"position": 0.0, "velocity": 0.0}
        self.force = None

    def sense(self, signal):
        return self.readings[signal]

    def drive(self, name, velocity):
        raise AssertionError

    def push(self, name, force):
        self.force = force

    def brake(self, name):
        self.force = None


class Wire:
    def __init__(self, **changes):
        values = {
            "kind": "mit_motor",
            "bus": "can",
            "model": "DM4310",
            "mode": "torque",
            "can_id": 3,
            "reply_id": 0x13,
            "travel_mm_per_turn": 2e3 * math.pi,
            "watchdog_ms": 20,
        }
        self.shaft = Shaft()
        section = MitMotorSettings.model_validate(values | changes)
        self.motor = EmulatedMitMotor("m", section, self.shaft)
        self.now = 0.0

    def ask(self, data, identifier=3):
        """Send a frame, and return the answers as text."""
        self.now += 1e-3
        frame = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        self.motor.receive(frame, self.now)
        answers = self.motor.emit(self.now)
        assert all(answer.arbitration_id == 0x13 for answer in answers)
        return [bytes(answer.data).hex(" ") for answer in answers]


def test_each_frame_to_the_motor_is_answered_with_its_state():
    wire = Wire()
    assert wire.ask(EXIT) == ["03 7f ff 7f f7 ff 23 1e"]
    assert wire.ask(ENTER)[0].startswith("13 ")
    assert wire.ask(STILL)[0].startswith("13 ")
    assert wire.ask(ENTER, 4) == []
    assert wire.ask(EXIT)[0].startswith("03 ")


def test_registers_and_the_state_are_read_with_another_identifier():
    wire = Wire()
    assert wire.ask(bytes.fromhex("0300331500000000"), 0x7FF) == ["03 00 33 15 00 00 48 41"]
    assert wire.ask(bytes.fromhex("0300330900000000"), 0x7FF) == ["03 00 33 09 90 01 00 00"]
    assert wire.ask(bytes.fromhex("0400331500000000"), 0x7FF) == []
    assert wire.ask(bytes.fromhex("0300cc0000000000"), 0x7FF)[0].startswith("03 ")


def test_the_torque_is_that_of_spring_damper_and_feed_forward():
    wire = Wire()
    wire.ask(ENTER)
    wire.shaft.readings |= {"position": 1.0, "velocity": -2.0}
    # position 12.5 rad, velocity 30 rad/s, kp 0x010, kd 0x020, torque 10 N m
    wire.ask(bytes.fromhex("ff ff ff f0 10 02 0f ff"))
    kp, kd = 0x10 * 500 / 4095, 0x20 * 5 / 4095
    assert wire.shaft.force == pytest.approx(min(kp * 11.5 + kd * 32.0 + 10.0, 10.0))
    wire.ask(bytes.fromhex("80 00 80 00 10 02 00 00"))
    assert wire.shaft.force == pytest.approx(-10.0)
    wire.ask(bytes.fromhex("80 00 80 00 00 00 0a 00"))
    assert wire.shaft.force == pytest.approx(0xA00 * 20 / 4095 - 10.0)


@pytest.mark.parametrize("refreshed", [False, True])
def test_the_time_out_disables_a_damiao_motor_until_its_error_is_cleared(refreshed):
    wire = Wire()
    wire.ask(ENTER)
    wire.ask(bytes.fromhex("80 00 80 00 00 00 0a 00"))
    for _ in range(25):
        wire.now += 1e-3
        if refreshed:
            wire.ask(bytes.fromhex("0300cc0000000000"), 0x7FF)
        wire.motor.emit(wire.now)
    assert wire.shaft.force is None
    assert wire.ask(ENTER)[0].startswith("d3 ")
    assert wire.shaft.force is None
    assert wire.ask(CLEAR)[0].startswith("03 ")
    assert wire.ask(ENTER)[0].startswith("13 ")


def test_another_motor_obeys_commands_in_its_motor_mode_only():
    ranges = {"p_max_rad": 12.5, "v_max_rad_per_s": 50, "t_max_nm": 18}
    wire = Wire(model="AK80-9", **ranges)
    push = bytes.fromhex("80 00 80 00 00 00 0a 00")
    wire.ask(push)
    wire.ask(ENTER)
    assert wire.shaft.force == 0.0
    wire.ask(push)
    assert wire.shaft.force > 4.0
    wire.now += 0.03
    wire.motor.emit(wire.now)
    assert wire.shaft.force == 0.0
    assert wire.ask(EXIT) == ["03 7f ff 7f f7 ff 23 00"]
