"""Data flow of the controller: each channel and each dt, on a rig with distinct values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from drivers import Ages, Command, Measurement, Rig, RigError
from estimation import ExpectedIntervals, Gate, MatchedFilter, Misfit, paper_preset
from sim_backend import CUBES, SimulatedRig
from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.clock import Tick, VirtualClock
from teleop.control.conditions import Teleoperation
from teleop.control.controller import Controller
from teleop.control.coupling import Coupling
from teleop.control.link import DirectLink
from teleop.control.tare import NO_TARE, Tare
from teleop.recording.recording import from_columns
from teleop.safety import Fault, Limits, Mode, Request
from teleop.safety.channels import DetectedFault
from teleop.safety.limits import default_channel_limits
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.estimation import Estimation, StreamEstimation
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_controller

PERIOD = 1e-3
FAILED = Request(faults=(DetectedFault(Fault.EMERGENCY_STOP, "key", math.nan, math.nan, math.nan),))
WIDE = Limits(
    max_velocity=10.0,
    max_acceleration=1e6,
    max_master_velocity=10.0,
    max_master_acceleration=1e6,
    following_error=1.0,
    rest_velocity=2.0,
    start_ramp=1e-9,
    preflight=10e-3,
    channels={
        name: replace(channel, max_rate=math.inf, high=10.0 if "velocity" in name else 1e3)
        for name, channel in default_channel_limits().items()
    },
)
"""Limits that are never reached; limits are tested in tests/teleop/safety."""
SKIPPED = [3 if n % 20 == 10 else 0 for n in range(300)]
TIMES = np.cumsum(
    PERIOD * (1.0 + np.array(SKIPPED) + 0.5 * np.random.default_rng(0).uniform(-1.0, 1.0, 300))
)


class SpyRig(Rig):
    """A rig with different values in every sample, whose drives apply a third of the command."""

    def __init__(self, failing: str = "", always: bool = False, **overrides: float) -> None:
        self.tick = -1
        self.unconfirmed: Sequence[int] = ()
        """Ticks at which `idle` is not confirmed."""
        self.always = always
        self.failing = failing
        self.overrides = overrides
        self.written: list[Command] = []
        self.calls: list[str] = []

    def open(self): ...

    def close(self): ...

    def enable(self):
        self.calls.append(f"enable at {self.tick}")
        return True

    def idle(self):
        self.calls.append(f"idle at {self.tick}")
        return self.tick not in self.unconfirmed

    def channels(self, n):
        t = TIMES[n]
        x = 4e-3 + 3e-3 * math.sin(9.0 * t)
        return {
            "master_force": 1.0 + 2.0 * math.sin(5.0 * t),
            "master_position": 0.1 + t,
            "slave_position": x,
            "contact_force": 2100.0 * x + 20.0 * 27e-3 * math.cos(9.0 * t),
            "slave_velocity": 0.7 + t,
        }

    def read(self):
        self.tick += 1
        if self.failing == "read" and self.tick == 200:
            raise OSError("the cable is out")
        values = self.channels(self.tick) | (
            self.overrides if self.always or self.tick == 200 else {}
        )
        ages = Ages(1e-3, 2e-3, 3e-3, 3e-3, 5e-3)
        return Measurement(time=float(TIMES[self.tick]), age=ages, **values)

    def write(self, command):
        if self.failing == "write" and self.tick == 200:
            raise OSError("the cable is out")
        self.written.append(command)
        return Command(*(velocity / 3.0 for velocity in command))


def make(rig, condition=None, limits=WIDE, tare=NO_TARE):
    return Controller(
        rig,
        condition or Teleoperation(),
        DirectLink(Admittance(AdmittanceParameters()), Coupling(0.5, position_gain=2.0)),
        PERIOD,
        limits,
        tare,
        stopwatch=iter(range(10**9)).__next__,
    )


def at(position):
    """Return a measurement with the slave at a position [m]."""
    return Measurement(0.0, 0.0, 0.0, position, 0.0, 0.0, Ages(*[0.0] * 5))


TARE = Tare(master_force=0.5, contact_force=-0.25, slave_position=1e-3)


def record(rig, controller):
    """Run the ticks; return what their stream contains, with the estimates, and the events."""
    bank = paper_preset().bank()
    stream, events = Stream(Layout(bank), len(SKIPPED)), []
    stream._missed[0] = 9
    for skipped in SKIPPED:
        r = controller.tick(Tick(0.25, True, skipped, 0.125), Request(arm=True))
        stream.write(r)
        events += r.events
    reader, estimation = stream.reader(), Estimation(MatchedFilter(20.0), bank)
    StreamEstimation(estimation, reader, print).advance()
    columns = reader.columns(1, stream.newest + 1)
    return from_columns(stream.schema, columns, [], {}), events


def test_every_stage_gets_its_channel_and_the_measured_dt():
    rig = SpyRig()
    recording, events = record(rig, make(rig, tare=TARE))
    assert [event.mode for event in events] == [Mode.IDLE, Mode.READY, Mode.ACTIVE]
    armed = int(np.argmax(recording["mode"] == Mode.ACTIVE))
    assert rig.calls == [f"enable at {armed}"]

    dt = np.diff(TIMES, prepend=TIMES[0] - PERIOD)
    channels = [rig.channels(n) for n in range(len(TIMES))]
    position = np.array([c["slave_position"] for c in channels]) - TARE.slave_position
    force = np.array([c["contact_force"] for c in channels]) - TARE.contact_force
    hand = np.array([c["master_force"] for c in channels]) - TARE.master_force
    x, v, f = (np.full(len(TIMES), math.nan) for _ in range(3))
    regression = MatchedFilter(20.0).run(position[armed:], force[armed:], dt[armed:])
    x[armed:], v[armed:], f[armed:] = regression[:3]
    bank = paper_preset().bank()
    estimates = bank.run(*regression)
    misfit = Misfit(bank).run(regression, estimates, bank.opened)
    gate = Gate(paper_preset().gate)
    contact = []
    for sample in zip(v[armed:], x[armed:], f[armed:], dt[armed:], strict=True):
        gate.update(sample[:2], *sample[2:])
        contact.append(float(gate.contact))
    bounds = ExpectedIntervals().run(*regression[:4], bank.opened)
    admittance, coupling = Admittance(AdmittanceParameters()), Coupling(0.5, 2.0)
    coupling.align(admittance, at(position[armed]))
    desired = [Command(0.0, 0.0)] * (armed + 1)
    for n in range(armed + 1, len(TIMES)):
        admittance.step(hand[n], dt[n])
        desired.append(coupling.command(admittance, at(position[n])))
    idle = [math.nan] * armed
    drive_force = np.where(np.arange(len(TIMES)) > armed, hand, 0.0)

    master, slave = np.array(desired).T
    expected = {
        "time": TIMES - TIMES[0] - WIDE.preflight - PERIOD,
        "dt": dt,
        "slave_position": position,
        "contact_force": force,
        "paired_position": idle + list(position[armed:]),
        "paired_force": idle + list(force[armed:]),
        "paired_dt": idle + list(dt[armed:]),
        "x": x,
        "v": v,
        "f": f,
        "slave_velocity": [c["slave_velocity"] for c in channels],
        "master_position": [c["master_position"] for c in channels],
        "master_force": hand,
        "drive_force": drive_force,
        "desired_slave_velocity": slave,
        "desired_master_velocity": master,
        "commanded_slave_velocity": slave,
        "commanded_master_velocity": master,
        "applied_slave_velocity": slave / 3.0,
        "applied_master_velocity": master / 3.0,
        "master_force_age": np.full(len(TIMES), 1e-3),
        "master_position_age": np.full(len(TIMES), 2e-3),
        "slave_position_age": np.full(len(TIMES), 3e-3),
        "contact_force_age": np.full(len(TIMES), 3e-3),
        "slave_velocity_age": np.full(len(TIMES), 5e-3),
        "lateness": np.full(len(TIMES), 0.25),
        "overrun": np.ones(len(TIMES)),
        "skipped": SKIPPED,
        "busy_time": np.full(len(TIMES), 0.125),
        "dropped": np.full(len(TIMES), 9.0),
        "read_time": np.ones(len(TIMES)),
        "compute_time": np.full(len(TIMES), 2.0),
        "write_time": np.ones(len(TIMES)),
        "limited": np.zeros(len(TIMES)),
        "target": np.full(len(TIMES), np.nan),
        "phase": np.full(len(TIMES), np.nan),
        "k_bound": idle + list(bounds[0]),
        "b_bound": idle + list(bounds[1]),
        "contact": idle + contact,
    }
    for name, e in estimates.items():
        expected |= {f"{name}_b": idle + list(e.b), f"{name}_k": idle + list(e.k)}
        expected |= {f"{name}_b_std": idle + list(e.b_std), f"{name}_k_std": idle + list(e.k_std)}
        expected[f"{name}_held"] = np.zeros(len(TIMES))
        expected[f"{name}_misfit"] = idle + list(misfit[name])
    assert set(recording.columns) == {*expected, "mode"}
    for name, column in expected.items():
        np.testing.assert_allclose(recording[name], column, rtol=1e-9, atol=1e-12, err_msg=name)
    assert [c.slave_velocity for c in rig.written] == list(recording["commanded_slave_velocity"])


@pytest.mark.parametrize("channel", ["master_force", "slave_position", "contact_force"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_channel_that_is_not_a_number_trips_and_reaches_no_drive(channel, value):
    rig = SpyRig(**{channel: value})
    recording, events = record(rig, make(rig))
    fault = next(event for event in events if event.fault)
    assert fault.source == channel
    assert fault.time == pytest.approx(recording["time"][200])
    assert all(math.isfinite(v) for command in rig.written for v in command)
    assert not recording["commanded_slave_velocity"][250:].any()
    assert np.isnan(recording["x"][200:]).all()
    assert rig.calls[-1].startswith("idle")


def test_an_absent_channel_may_be_missing_but_a_present_one_may_not_become_missing():
    missing = {"slave_velocity": math.nan, "master_position": math.nan}
    rig = SpyRig(always=True, **missing)
    _, events = record(rig, make(rig))
    assert events[-1].mode is Mode.ACTIVE
    rig = SpyRig(**missing)
    _, events = record(rig, make(rig))
    assert events[-1].fault is Fault.NOT_A_NUMBER


class Broken(Teleoperation):
    def __init__(self, answer):
        self.answer, self.calls = answer, 0

    def drive_force(self, t, measurement):
        self.calls += 1
        if self.calls < 100:
            return super().drive_force(t, measurement)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (KeyError("gain"), "control failure: KeyError: 'gain'"),
        (math.nan, "control failure: the desired velocities are nan and nan m/s"),
    ],
)
def test_a_condition_that_fails_trips_in_the_same_tick(answer, text):
    rig = SpyRig()
    controller = make(rig, Broken(answer))
    recording, events = record(rig, controller)
    assert events[-1].fault is Fault.CONTROL_FAILURE
    assert events[-1].text == text
    failing = int(np.argmax(recording["mode"] == Mode.FAULT))
    assert not recording["commanded_slave_velocity"][failing + 20 :].any()
    assert controller.error is (answer if isinstance(answer, Exception) else None)


@pytest.mark.parametrize("call", ["read", "write"])
def test_a_rig_that_fails_is_disabled_immediately(call):
    rig = SpyRig(failing=call)
    controller = make(rig)
    recording, events = record(rig, controller)
    assert events[-1].fault is Fault.RIG_FAILURE
    assert events[-1].text == "rig failure: OSError: the cable is out"
    assert rig.calls[1] == "idle at 200"
    assert not recording["commanded_slave_velocity"][201:].any()
    assert isinstance(controller.error, OSError)


def test_after_a_fault_nothing_moves_until_a_person_rearms():
    rig = SpyRig(contact_force=math.nan)
    controller = make(rig)
    modes = []
    for n in range(len(TIMES)):
        if n == 250:
            assert controller.mode is Mode.FAULT
            controller.rearm()
        modes.append(controller.tick(Tick(0.0, False, 0), Request(arm=True)).mode)
    assert set(modes[200:250]) == {Mode.FAULT}
    assert modes[-1] is Mode.ACTIVE
    with pytest.raises(ValueError, match="in mode fault only"):
        controller.rearm()


def test_the_admittance_follows_the_limited_command():
    slow = replace(WIDE, max_master_velocity=0.02)
    rig = SpyRig()
    recording, _ = record(rig, make(rig, limits=slow))
    flags = recording["limited"].astype(int)
    assert flags.any()
    assert np.abs(recording["commanded_master_velocity"]).max() <= 0.02 * (1 + 1e-12)
    free = record(SpyRig(), make(SpyRig()))[0]
    beyond = np.abs(recording["desired_master_velocity"]).max()
    assert beyond < 0.5 * np.abs(free["desired_master_velocity"]).max()


def drive_and_tick(controller, clock, ticks, request):
    """Run some ticks and return the last record."""
    for _ in range(ticks):
        record = controller.tick(clock.wait(), request)
    return record


@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_the_slave_does_not_move_when_it_is_armed_or_armed_again(scale):
    clock = VirtualClock(1000.0)
    rig = SimulatedRig(replace(CUBES["soft"], glued=False), clock.now)
    settings = TrialSettings(clock="virtual", coupling=Coupling(scale, position_gain=10.0))
    with rig:
        controller = make_controller(settings, rig, clock)
        for position in (-4e-3, -2e-3):
            rig.plant.slave.x = position
            record = drive_and_tick(controller, clock, 500, Request(arm=True))
            assert record.mode is Mode.ACTIVE
            assert rig.plant.slave.x == pytest.approx(position, abs=5e-5)
            assert record.desired == pytest.approx((0.0, 0.0), abs=1e-3)
            assert drive_and_tick(controller, clock, 50, FAILED).mode is Mode.FAULT
            controller.rearm()


class SlowRig(SpyRig):
    """Drives that need some ticks to get ready."""

    def __init__(self, ready_at: int) -> None:
        super().__init__()
        self.ready_at = ready_at

    def enable(self):
        super().enable()
        return self.tick >= self.ready_at


def test_nothing_moves_and_no_time_passes_for_the_condition_until_the_drives_are_ready():
    class Watched(Teleoperation):
        times: ClassVar[list[float]] = []

        def drive_force(self, t, measurement):
            self.times.append(t)
            return super().drive_force(t, measurement)

    rig = SlowRig(ready_at=120)
    recording, _ = record(rig, make(rig, Watched()))
    armed = int(np.argmax(recording["mode"] == Mode.ACTIVE))
    assert armed == 120
    assert not recording["commanded_slave_velocity"][: armed + 1].any()
    assert Watched.times[0] == pytest.approx(TIMES[121] - TIMES[120])
    assert rig.calls[-1] == "enable at 120"


def test_drives_that_get_ready_are_disabled_when_the_start_is_cancelled():
    rig = SlowRig(ready_at=10**9)
    controller = make(rig)
    for _ in range(100):
        controller.tick(Tick(0.0, False, 0), Request(arm=True))
    controller.tick(Tick(0.0, False, 0), Request(stop="enough"))
    assert controller.mode is Mode.IDLE
    assert rig.calls[-1] == "idle at 100"


def test_a_drive_that_refuses_to_get_ready_is_a_rig_failure():
    class Refusing(SpyRig):
        def enable(self):
            raise RigError("drive slave not ready within 2 s")

    rig = Refusing()
    controller = make(rig)
    events = []
    for _ in range(100):
        events += controller.tick(Tick(0.0, False, 0), Request(arm=True)).events
    assert events[-1].fault is Fault.RIG_FAILURE
    assert "not ready" in events[-1].text
    assert rig.calls[-1].startswith("idle")


@pytest.mark.parametrize(
    "request_",
    [
        Request(arm=True, stop="Ctrl-C"),
        Request(arm=True, halt=True),
        Request(arm=True, faults=(DetectedFault(Fault.EMERGENCY_STOP, "key", 0.0, 0.0, 0.0),)),
    ],
    ids=["stop", "halt", "key"],
)
def test_a_stop_at_the_tick_of_arming_enables_no_drive(request_):
    rig = SpyRig()
    controller = make(rig)
    while controller.mode is not Mode.READY:
        controller.tick(Tick(0.0, False, 0))
    for _ in range(50):
        controller.tick(Tick(0.0, False, 0), request_)
    assert rig.calls == []
    assert controller.mode is not Mode.ACTIVE


def test_a_fault_at_the_tick_of_arming_enables_no_drive():
    class Opened(SpyRig):
        def read(self):
            return super().read()._replace(emergency_stop=self.tick >= 30)

    rig = Opened()
    controller = make(rig)
    for _ in range(30):
        controller.tick(Tick(0.0, False, 0))
    assert controller.mode is Mode.READY
    controller.tick(Tick(0.0, False, 0), Request(arm=True))
    assert controller.mode is Mode.FAULT
    assert rig.calls == []


class StuckRig(SpyRig):
    """A rig whose `write` and `idle` fail in some ticks."""

    def __init__(self, no_write=(), no_idle=(), **overrides):
        super().__init__(**overrides)
        self.no_write, self.no_idle = no_write, no_idle
        self.fed: list[int] = []

    def write(self, command):
        if self.tick in self.no_write:
            raise OSError("write: the cable is out")
        self.fed.append(self.tick)
        return super().write(command)

    def idle(self):
        confirmed = super().idle()
        if self.tick in self.no_idle:
            raise OSError("idle: the cable is out")
        return confirmed


@pytest.mark.parametrize("no_write", [(), range(200, 205)])
def test_idle_is_repeated_until_it_succeeds_and_no_commands_are_sent_meanwhile(no_write):
    rig = StuckRig(no_write, range(200, 230), contact_force=100.0)
    controller = make(rig)
    recording, events = record(rig, controller)
    faults = [event.fault for event in events if event.fault]
    assert set(faults) == {Fault.FORCE_LIMIT, Fault.RIG_FAILURE}
    idled = [int(call.split()[-1]) for call in rig.calls if call.startswith("idle")]
    assert idled == list(range(200, 231))
    assert [tick for tick in rig.fed if 200 <= tick <= 230] == ([] if no_write else [200])
    assert all(command == Command(0.0, 0.0) for command in rig.written[200:])
    assert not recording["applied_slave_velocity"][200:].any()


def test_idle_is_repeated_until_the_drives_confirm_it_and_no_commands_are_sent_meanwhile():
    rig = StuckRig(contact_force=100.0)
    rig.unconfirmed = range(200, 230)
    _, events = record(rig, make(rig))
    assert {event.fault for event in events if event.fault} == {Fault.FORCE_LIMIT}
    assert [call for call in rig.calls if call.startswith("idle")] == [
        f"idle at {tick}" for tick in range(200, 231)
    ]
    assert [tick for tick in rig.fed if 200 <= tick <= 230] == [200]


def test_a_failed_condition_does_not_hide_an_emergency_stop_or_a_rig_failure():
    """The ramp takes 30 ticks; a more severe fault ends it immediately."""
    gentle = replace(WIDE, max_acceleration=2.0, max_master_acceleration=4.0)

    class Failing(SpyRig):
        def read(self):
            measurement = super().read()
            return measurement._replace(emergency_stop=self.sick == "input" and self.tick >= 205)

        def write(self, command):
            if self.sick == "write" and self.tick == 205:
                raise OSError("the cable is out")
            return super().write(command)

    for sick in ("", "input", "write"):
        rig = Failing()
        rig.sick = sick
        condition = Broken(KeyError("gain"))
        condition.calls = -80
        recording, events = record(rig, make(rig, condition, limits=gentle))
        speed = np.abs(recording["commanded_slave_velocity"])
        assert next(e.fault for e in events if e.fault) is Fault.CONTROL_FAILURE
        assert speed[204] > 0.0
        assert speed[206] > 0.0 or sick
        assert not sick or not speed[206:].any()
        assert not sick or rig.calls[1] == "idle at 205"


@pytest.mark.parametrize("mode", ["active", "fault"])
def test_a_rig_that_always_returns_the_same_measurement_is_stopped(mode):
    class Standing(SpyRig):
        def read(self):
            if self.tick < 150:
                self.last = super().read()
            return self.last

    rig = Standing()
    controller = make(rig, Broken(KeyError("gain")) if mode == "fault" else None)
    for _ in range(280):
        controller.tick(Tick(0.0, False, 0), Request(arm=True))
    assert controller.mode is Mode.FAULT
    assert rig.written[-1] == Command(0.0, 0.0)
    assert rig.calls[-1].startswith("idle")


def test_a_rig_that_cannot_be_rearmed_leaves_the_fault_in_force():
    rig = SpyRig("write")
    controller = make(rig)
    record(rig, controller)
    assert controller.mode is Mode.FAULT

    def refuse():
        raise RigError("still hot")

    rig.rearm = refuse
    with pytest.raises(RigError):
        controller.rearm()
    assert controller.mode is Mode.FAULT
    assert controller.error
