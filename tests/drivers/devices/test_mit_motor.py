"""The driver of motors with the MIT mode and the emulated motor, in virtual time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from drivers.codecs import mit_motor as codec
from drivers.device import NO_SAMPLE, ForceDrive, ImpedanceDrive
from drivers.devices.mit_motor import MitMotor
from drivers.devices.mit_motor_settings import MitMotorSettings
from drivers.rig import RigError
from sim_backend.wire.devices.mit_motor import EmulatedMitMotor
from sim_backend.wire.emulated_device import Mount

TICK = 1e-3
RADIUS = 0.05
"""Length of the lever [m]."""
WATCHDOG = 0.05
DAMIAO = {"model": "DM4310", "can_id": 1, "reply_id": 0x11}
CUBEMARS = {
    "model": "AK80-9",
    "can_id": 0x17,
    "reply_id": 0x17,
    "p_max_rad": 12.5,
    "v_max_rad_per_s": 50,
    "t_max_nm": 18,
}
makers = pytest.mark.parametrize("maker", [DAMIAO, CUBEMARS], ids=["damiao", "cubemars"])
FORCE = 20.0
"""Commanded force [N]."""
RESOLUTION = 18.0 / 4095 / RADIUS
"""Half of the largest step of a force [N]."""


def settings(maker: dict[str, Any], **changes: object) -> MitMotorSettings:
    values = {
        "kind": "mit_motor",
        "bus": "can",
        "mode": "torque",
        "travel_mm_per_turn": RADIUS * 1e3 * math.tau,
        "watchdog_ms": WATCHDOG * 1e3,
    }
    return MitMotorSettings.model_validate(values | maker | changes)


class Handle(Mount):
    """Mount of the emulated motor."""

    def __init__(self) -> None:
        self.readings = {"position": 0.0, "velocity": 0.0}
        self.force: float | None = None
        """Force of the motor [N]; None while it is out of operation."""

    def sense(self, signal: str) -> float:
        return self.readings[signal]

    def drive(self, name: str, velocity: float) -> None:
        raise AssertionError

    def push(self, name: str, force: float) -> None:
        assert name == "axis"
        self.force = force

    def brake(self, name: str) -> None:
        self.force = None


class Bench:
    """A driver and an emulated motor in virtual time; it replaces the driver's bus."""

    name = "can"

    def __init__(self, maker: dict[str, Any], **changes: object) -> None:
        self.handle = Handle()
        self.device = MitMotor("master", settings(maker, **changes))
        self.motor = EmulatedMitMotor("master", settings(maker), self.handle)
        self.time = 10.0
        self.severed = self.deaf = False
        self.sent: list[can.Message] = []

    @property
    def drive(self) -> Any:
        return self.device.drives["axis"]

    def now(self) -> float:
        return self.time

    def send(self, identifier: int, data: bytes, extended: bool = False) -> None:
        frame = can.Message(arbitration_id=identifier, data=data, is_extended_id=extended)
        self.sent.append(frame)
        if not self.severed:
            self.motor.receive(frame, self.time)

    def tick(self) -> None:
        self.time += TICK
        for frame in self.motor.emit(self.time):
            if not (self.severed or self.deaf) and frame.arbitration_id in (
                self.device.identifiers()
            ):
                self.device.receive(frame, self.time)
        self.device.update(self.time)

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.tick()
        return bool(condition())

    def run(self, seconds: float, force: float | None = None) -> None:
        """Run ticks of a rig; without a force there is no command."""
        for _ in range(round(seconds / TICK)):
            self.tick()
            if force is not None:
                self.drive.command(force)
                self.device.transmit()

    def enable(self, ticks: int = 100) -> bool:
        for _ in range(ticks):
            if self.drive.enable():
                return True
            self.device.transmit()
            self.tick()
        return False


def started(maker: dict[str, Any], **changes: object) -> Bench:
    bench = Bench(maker, **changes)
    bench.device.start(bench)  # type: ignore[arg-type]
    return bench


def enabled(maker: dict[str, Any], **changes: object) -> Bench:
    bench = started(maker, **changes)
    assert bench.enable()
    return bench


def test_the_mode_chooses_the_kind_of_drive():
    assert isinstance(Bench(DAMIAO).drive, ForceDrive)
    assert isinstance(Bench(DAMIAO, mode="impedance").drive, ImpedanceDrive)


@pytest.mark.parametrize(
    ("maker", "changes", "words"),
    [
        (DAMIAO, {"model": "DM9999"}, "expected one of DM3507, DM4310"),
        (DAMIAO, {"can_id": 16}, "can_id 16: expected 1 to 15"),
        (DAMIAO, {"reply_id": 0}, "reply_id 0: expected the Master ID"),
        (DAMIAO, {"t_max_nm": 5}, "p_max_rad, v_max_rad_per_s missing: expected all ranges or"),
        (CUBEMARS, {"t_max_nm": None}, "t_max_nm missing: the AK80-9 cannot be asked"),
        (CUBEMARS, {"t_max_nm": 9}, "9 N m: expected 12.5 rad, 50 rad/s, 18 N m for the model"),
        (DAMIAO, {"mode": "velocity"}, "'impedance' or 'torque'"),
    ],
)
def test_settings_that_do_not_fit_the_model_are_refused(maker, changes, words):
    with pytest.raises(ValidationError, match=words):
        settings(maker, **changes)


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (10, 2, "register CTRL_MODE is 2: expected 1, the MIT mode"),
        (21, 3.0, r"ranges 3 rad, 30 rad/s, 10 N m \(PMAX.*expected 12.5 rad, 30 rad/s, 10 N m"),
        (23, 28.0, r"ranges 12.5 rad, 30 rad/s, 28 N m"),
        (9, 0, "register TIMEOUT is 0, so that the motor has no watchdog: expected 1000"),
        (9, 2000, "register TIMEOUT is 2000: expected 1000"),
    ],
)
def test_a_damiao_motor_whose_registers_differ_from_the_file_is_refused(register, value, words):
    bench = Bench(DAMIAO)
    bench.motor.registers[register] = value
    with pytest.raises(RigError, match=f"master: motor 1 on can: {words}"):
        bench.device.start(bench)
    assert bench.handle.force is None


def test_changed_ranges_of_a_damiao_motor_can_be_stated():
    ranges = {"p_max_rad": 6.0, "v_max_rad_per_s": 20.0, "t_max_nm": 4.0}
    bench = Bench(DAMIAO, **ranges)
    bench.motor.registers |= {21: 6.0, 22: 20.0, 23: 4.0}
    bench.handle.readings["position"] = 0.1
    bench.device.start(bench)
    assert bench.device.samples["position"].value == pytest.approx(0.1, abs=1e-5)


def test_a_damiao_motor_whose_registers_are_not_answered_is_refused():
    bench = Bench(DAMIAO)
    receive = bench.motor.receive
    bench.motor.receive = lambda frame, now: frame.data[3] == 21 or receive(frame, now)
    with pytest.raises(RigError, match="register PMAX is not answered"):
        bench.device.start(bench)


@makers
def test_a_silent_bus_is_refused(maker):
    bench = Bench(maker)
    bench.severed = True
    with pytest.raises(RigError, match=r"no answer with the identifier 0x1\d: expected a motor"):
        bench.device.start(bench)


@makers
def test_an_answer_of_another_motor_is_rejected(maker):
    bench = started(maker)
    data = bytes((0x05, *bytes(7)))
    frame = can.Message(
        arbitration_id=maker["reply_id"], data=data, is_extended_id=False, check=True
    )
    before = dict(bench.device.samples)
    bench.device.receive(frame, bench.time)
    bench.device.receive(
        can.Message(arbitration_id=maker["reply_id"], data=data[:6], is_extended_id=False), 0.0
    )
    assert bench.device.rejected == {"id": 1, "length": 1}
    assert bench.device.samples == before


@makers
def test_a_motor_that_was_left_running_is_stopped_at_the_start(maker):
    bench = enabled(maker)
    bench.run(0.01, FORCE)
    bench.device = MitMotor("master", settings(maker))
    bench.device.start(bench)
    assert bench.handle.force is None


@makers
def test_position_velocity_and_force_are_read_in_si_units(maker):
    bench = enabled(maker)
    bench.handle.readings |= {"position": -0.123, "velocity": 0.4}
    bench.run(0.01, FORCE)
    values = {name: sample.value for name, sample in bench.device.samples.items()}
    assert values["position"] == pytest.approx(-0.123, abs=25.0 / 65535 * RADIUS)
    assert values["velocity"] == pytest.approx(0.4, abs=100.0 / 4095 * RADIUS)
    assert values["force"] == pytest.approx(FORCE, abs=4.0 * RESOLUTION)
    for sample in bench.device.samples.values():
        assert bench.time - sample.time < 2 * TICK


@makers
def test_the_position_is_continued_beyond_the_end_of_its_range(maker):
    bench = started(maker)
    for turn in (0.3, 0.6, 0.9, 1.2, 0.9, 0.4, -0.1, -0.6, -0.9):
        bench.handle.readings["position"] = turn
        bench.run(0.01)
        found = bench.device.samples["position"].value
        assert found == pytest.approx(turn, abs=3 * 25.0 / 65535 * RADIUS)


def test_in_impedance_mode_the_end_of_the_range_is_an_error():
    bench = enabled(DAMIAO, mode="impedance")
    for turn in (0.3, 0.6, 0.65):
        bench.handle.readings["position"] = turn
        bench.tick()
        bench.device.transmit()
        bench.tick()
    assert bench.device.error == "the position is out of the range of +-12.5 rad"


@makers
def test_enabled_without_force_and_then_exerts_the_commanded_one(maker):
    bench = started(maker)
    while not bench.drive.enable():
        bench.drive.command(FORCE)
        bench.device.transmit()
        bench.tick()
        assert abs(bench.handle.force or 0.0) <= 2.0 * RESOLUTION
    assert bench.drive.command(FORCE) == pytest.approx(FORCE, abs=RESOLUTION)
    sent = bench.drive.command(-FORCE)
    bench.device.transmit()
    bench.tick()
    assert bench.handle.force == pytest.approx(sent)


def test_a_force_beyond_the_range_of_the_motor_is_limited():
    assert enabled(DAMIAO).drive.command(1e3) == pytest.approx(10.0 / RADIUS)


def test_a_spring_and_a_damper_act_in_the_motor():
    bench = enabled(DAMIAO, mode="impedance")
    stiffness, damping = bench.drive.rounded(1000.0, 20.0)
    assert stiffness == pytest.approx(1000.0, abs=0.5 * 500 / 4095 / RADIUS**2)
    assert damping == pytest.approx(20.0, abs=0.5 * 5 / 4095 / RADIUS**2)
    bench.handle.readings |= {"position": 0.02, "velocity": 0.1}
    position, velocity = bench.drive.command(0.03, 0.0, stiffness, damping)
    bench.device.transmit()
    bench.tick()
    expected = stiffness * (position - 0.02) + damping * (velocity - 0.1)
    assert bench.handle.force == pytest.approx(expected, abs=10.0 / 4095 / RADIUS * 1.001)


def test_gains_beyond_the_limits_of_the_frame_are_limited():
    drive = Bench(DAMIAO, mode="impedance").drive
    assert drive.rounded(1e9, 1e9) == pytest.approx((500 / RADIUS**2, 5 / RADIUS**2))


@makers
def test_a_motor_that_gets_no_commands_exerts_no_force(maker):
    bench = enabled(maker)
    bench.run(0.01, FORCE)
    bench.run(WATCHDOG + 3 * TICK)
    assert not bench.handle.force


def test_a_damiao_motor_reports_its_watchdog():
    bench = enabled(DAMIAO)
    bench.run(0.01, FORCE)
    assert bench.drive.reports_watchdog
    bench.run(WATCHDOG + 10e-3)
    assert bench.device.error == "communication lost: no command arrived in time"
    bench.run(0.2)
    assert bench.drive.command(FORCE) == pytest.approx(0.0, abs=RESOLUTION)


def test_another_motor_does_not_and_gets_no_request_that_resets_its_watchdog():
    bench = enabled(CUBEMARS)
    bench.run(0.01, FORCE)
    assert not bench.drive.reports_watchdog
    bench.sent.clear()
    bench.run(0.5)
    assert not bench.sent
    assert bench.device.error == ""


@makers
def test_missing_answers_are_an_error(maker):
    bench = enabled(maker)
    bench.run(0.01, FORCE)
    bench.deaf = True
    bench.run(WATCHDOG - 2 * TICK, FORCE)
    assert not bench.device.error
    bench.run(4 * TICK, FORCE)
    assert bench.device.error.startswith("no answer for 5")


@makers
def test_an_error_of_the_motor_is_reported_until_it_is_enabled_again(maker):
    bench = enabled(maker)
    bench.run(0.01, FORCE)
    bench.motor.fault = 0xA if maker is DAMIAO else 2
    bench.run(3 * TICK, FORCE)
    assert bench.device.error == "over-current"
    assert not bench.handle.force
    assert not bench.enable(20)
    if maker is CUBEMARS:
        bench.motor.fault = 0
    assert bench.wait_for(bench.drive.idle, 0.1)
    assert bench.enable()
    assert bench.device.error == ""


def test_an_error_that_cannot_be_cleared_is_reported():
    bench = started(DAMIAO)
    emit = bench.motor.emit

    def hot(now: float) -> list[can.Message]:
        bench.motor.fault = 0xB
        return emit(now)

    bench.motor.emit = hot  # type: ignore[method-assign]
    assert not bench.enable(200)
    assert bench.device.error == "over-temperature of the MOSFETs"


def test_a_damiao_motor_that_leaves_operation_by_itself_is_an_error():
    bench = enabled(DAMIAO)
    bench.run(0.01, FORCE)
    bench.motor.receive(
        can.Message(arbitration_id=1, data=codec.EXIT, is_extended_id=False), bench.time
    )
    bench.run(3 * TICK, FORCE)
    assert bench.device.error == "left operation by itself"


@makers
def test_idle_is_confirmed_and_the_state_is_still_read(maker):
    bench = enabled(maker)
    bench.run(0.01, FORCE)
    assert not bench.drive.idle()
    assert bench.wait_for(bench.drive.idle, 0.05)
    assert bench.handle.force is None
    bench.handle.readings["position"] = 0.05
    bench.run(0.02)
    assert bench.device.samples["position"].value == pytest.approx(0.05, abs=1e-4)
    assert bench.handle.force is None


@makers
def test_an_answer_to_an_earlier_frame_confirms_no_stop(maker):
    bench = started(maker)
    bench.drive.enable()
    bench.device.transmit()
    bench.severed = False
    held = bench.motor.emit(bench.time)  # on their way
    bench.severed = True  # the requests to leave operation are lost
    for frame in held:
        assert not bench.drive.idle()
        bench.device.receive(frame, bench.time)
    assert not bench.drive.idle()


def test_until_a_stop_is_confirmed_it_is_requested_ever_more_rarely():
    bench = enabled(CUBEMARS)
    bench.run(0.01, FORCE)
    bench.sent.clear()
    bench.deaf = True
    times = []
    for _ in range(500):
        assert not bench.device.ping()
        assert not bench.drive.idle()
        times += [bench.time] * (len(bench.sent) - len(times))
        bench.tick()
    assert {bytes(frame.data) for frame in bench.sent} == {codec.EXIT}
    pauses = [b - a for a, b in itertools.pairwise(times)]
    assert pauses[:3] == pytest.approx([5e-3, 10e-3, 20e-3], abs=1.5 * TICK)
    assert pauses[-1] == pytest.approx(2 * WATCHDOG, abs=1.5 * TICK)


@makers
def test_answers_a_ping(maker):
    bench = started(maker)
    assert bench.device.ping()
    assert not bench.device.answered()
    bench.tick()
    assert bench.device.answered()
    bench.enable()
    assert not bench.device.ping()


@makers
@given(frames=st.lists(st.binary(max_size=8), max_size=20), wanted=st.booleans())
def test_no_frame_raises_or_gives_a_value_that_is_not_finite(maker, frames, wanted):
    bench = enabled(maker) if wanted else started(maker)
    for data in frames:
        message = can.Message(arbitration_id=maker["reply_id"], data=data, is_extended_id=False)
        bench.device.receive(message, bench.time)
    for sample in bench.device.samples.values():
        assert sample == NO_SAMPLE or math.isfinite(sample.value)
