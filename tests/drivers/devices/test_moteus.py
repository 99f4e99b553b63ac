"""The moteus driver with the emulated controller, in virtual time."""

from __future__ import annotations

import math

import can
import pytest

from drivers.device import ForceDrive, VelocityDrive
from drivers.devices.moteus import Moteus, MoteusSettings
from drivers.rig import RigError
from sim_backend.wire.devices.moteus import EmulatedMoteus
from sim_backend.wire.emulated_device import Mount

TICK = 1e-3
TRAVEL = 5e-3
LEVER = TRAVEL / math.tau
WATCHDOG = 0.05


class Bench(Mount):
    """A driver and an emulated controller; it replaces the driver's bus and the motor."""

    name = "can"

    def __init__(self, mode="velocity", node=2, **entries):
        section = MoteusSettings(
            kind="moteus",
            bus="can",
            node=node,
            mode=mode,
            travel_mm_per_turn=5.0,
            max_velocity_mm_per_s=50.0,
            max_torque_nm=0.5,
            watchdog_ms=WATCHDOG * 1e3,
            **entries,
        )
        self.device = Moteus("slave", section)
        self.emulated = EmulatedMoteus("slave", section, self)
        self.drive_ = self.device.drives["axis"]
        self.time = 1.0
        self.readings = {"position": 0.01, "velocity": 0.0, "force": 2.0}
        self.pushed = 0.0
        self.braked = True
        self.severed = self.deaf = False
        self.sent = []

    def sense(self, signal):
        return self.readings[signal]

    def drive(self, name, velocity):
        assert name == "axis"
        self.readings["velocity"], self.braked = velocity, False

    def push(self, name, force):
        self.pushed, self.braked = force, False

    def brake(self, name):
        self.readings["velocity"], self.pushed, self.braked = 0.0, 0.0, True

    def now(self):
        return self.time

    def send(self, identifier, data, extended, fd, bitrate_switch):
        assert extended
        assert fd
        assert bitrate_switch
        frame = can.Message(arbitration_id=identifier, data=data, is_fd=True, check=True)
        self.sent.append(frame)
        if not self.severed:
            self.emulated.receive(frame, self.time)

    def tick(self):
        self.time += TICK
        for frame in self.emulated.emit(self.time):
            route = frame.arbitration_id | frame.is_extended_id << 31
            if not self.deaf and route in self.device.identifiers():
                self.device.receive(frame, self.time)
        self.device.update(self.time)

    def wait_for(self, condition, seconds):
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.tick()
        return bool(condition())

    def start(self):
        self.device.start(self)
        return self

    def operate(self, command, ticks=30):
        """Request operation as the rig does; return whether the drive is in operation."""
        for _ in range(ticks):
            self.tick()
            ready = self.drive_.enable()
            self.drive_.command(command if ready else 0.0)
            self.device.transmit()
        return ready


@pytest.fixture(params=[2, 40])
def bench(request):
    """A started controller. The replies of node 40 have identifiers of 29 bits."""
    return Bench(node=request.param).start()


def refusal(bench):
    with pytest.raises(RigError) as refused:
        bench.start()
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_its_signals_are_measured_at_each_tick_without_commands(bench):
    bench.tick()
    bench.tick()
    values = {signal: sample.value for signal, sample in bench.device.samples.items()}
    assert values == pytest.approx({"position": 0.01, "velocity": 0.0, "force": 2.0}, rel=1e-6)
    assert bench.time - bench.device.samples["position"].time < 2 * TICK
    assert not bench.device.rejected


def test_a_velocity_moves_the_motor_and_is_limited(bench):
    assert bench.operate(0.02)
    assert isinstance(bench.drive_, VelocityDrive)
    assert bench.readings["velocity"] == pytest.approx(0.02)
    assert bench.drive_.command(1.0) == 0.05
    assert not bench.device.error


def test_a_force_moves_the_motor_and_is_limited():
    bench = Bench("torque").start()
    assert bench.operate(-3.0)
    assert isinstance(bench.drive_, ForceDrive)
    assert bench.pushed == pytest.approx(-3.0, rel=1e-6)
    assert bench.drive_.command(1e6) == pytest.approx(0.5 / LEVER)


@pytest.mark.parametrize("mode", ["velocity", "torque"])
def test_nothing_is_commanded_before_the_controller_operates(mode):
    bench = Bench(mode).start()
    for _ in range(6):
        bench.tick()
        if not bench.drive_.enable():
            assert bench.drive_.command(1.0) == 0.0
        bench.device.transmit()
        assert bench.braked or (bench.pushed == 0.0 and bench.readings["velocity"] == 0.0)


def test_without_commands_the_watchdog_stops_the_motor_and_this_is_an_error(bench):
    bench.operate(0.02)
    last = bench.time
    assert bench.wait_for(lambda: bench.device.error, 1.0)
    assert WATCHDOG <= bench.time - last < WATCHDOG + 5 * TICK
    assert bench.device.error == "its watchdog has expired"
    assert bench.braked


def test_after_an_expired_watchdog_it_operates_again_when_enabled_again(bench):
    bench.operate(0.02)
    for _ in range(100):
        bench.tick()
    assert bench.wait_for(bench.drive_.idle, 0.1)
    assert bench.operate(0.01)
    assert not bench.device.error


@pytest.mark.parametrize(("fault", "text"), [(33, "motor driver fault"), (77, "fault 77")])
def test_a_fault_of_the_controller_is_an_error_and_stops_the_command(bench, fault, text):
    bench.operate(0.02)
    bench.emulated.trip(fault)
    bench.operate(0.02, ticks=3)
    assert bench.device.error == text
    assert bench.drive_.command(0.02) == 0.0


def test_a_controller_that_was_reset_is_an_error(bench):
    bench.operate(0.02)
    bench.emulated = EmulatedMoteus("slave", bench.device.settings, bench)
    bench.operate(0.02, ticks=5)
    assert bench.device.error == "in mode 2: expected position"
    assert bench.drive_.command(0.02) == 0.0


def test_missing_answers_are_an_error(bench):
    bench.operate(0.02)
    bench.deaf = True
    bench.operate(0.02, ticks=round(WATCHDOG / TICK) + 3)
    assert bench.device.error.startswith("no answer for 5")


def test_a_stop_is_repeated_until_its_own_reply(bench):
    bench.operate(0.02)
    bench.severed = True
    assert not any(bench.drive_.idle() or bench.tick() for _ in range(10))
    bench.severed = False
    assert bench.wait_for(bench.drive_.idle, 0.01)
    assert bench.braked


def test_an_earlier_reply_in_the_mode_stopped_confirms_no_stop(bench):
    bench.send(0x8000 | bench.device.settings.node, bytes.fromhex("1100"), True, True, True)
    late = bench.emulated.emit(bench.time)[-1]
    bench.operate(0.02)
    bench.severed = True
    assert not bench.drive_.idle()
    bench.device.receive(late, bench.time)
    assert not bench.drive_.idle()


def test_the_round_trip_ends_with_the_answer_to_its_request(bench):
    assert bench.device.ping()
    assert not bench.device.answered()
    bench.tick()
    assert bench.device.answered()


def test_a_register_that_the_firmware_does_not_have_is_an_error(bench):
    del bench.emulated._command[0x28]
    bench.emulated._enter = lambda mode, now: setattr(bench.emulated, "mode", mode)
    bench.operate(0.0)
    assert bench.device.error == "refuses register 0x028"


def test_a_controller_that_does_not_answer_is_named():
    bench = Bench()
    bench.severed = True
    assert refusal(bench) == (
        "slave: node 2 on can: no answer in 1 s: expected a moteus with power on"
    )


@pytest.mark.parametrize(
    ("entries", "identity", "problem"),
    [
        ({}, {0x102: 4, 0x101: 0x0000F0}, "register map version 4 (firmware 0.0.240), expected 5"),
        ({"serial_number": "X"}, {}, "serial number AAA6GwAALF0AAAB3, expected X"),
        ({"model": "300"}, {}, "model 0, expected 300"),
    ],
)
def test_another_controller_is_refused(entries, identity, problem):
    bench = Bench(**entries)
    bench.emulated.identity |= identity
    assert refusal(bench) == f"slave: node 2 on can: {problem}"


def test_a_controller_that_moves_is_stopped_at_the_start():
    bench = Bench().start()
    bench.operate(0.02)
    bench.device = Moteus("slave", bench.device.settings)
    bench.start()
    assert bench.braked


def test_malformed_frames_and_values_that_are_no_numbers_are_counted(bench):
    frame = can.Message(arbitration_id=2 << 8, is_fd=True, data=b"\x2f\x01")
    bench.device.receive(frame, bench.time)
    bench.readings["position"] = math.nan
    bench.tick()
    bench.tick()
    assert bench.device.rejected["malformed"] == 1
    assert bench.device.rejected["not finite"] >= 1
