"""Every fault of every channel is detected and named at the tick at which it occurs."""

from __future__ import annotations

import math

import pytest

from drivers import CHANNELS, STANDSTILL, Ages, Command, Measurement
from teleop.safety import (
    ChannelLimits,
    Fault,
    Limits,
    Mode,
    Request,
    Supervision,
    activate,
    supervise,
)

DT = 1.0 / 512.0
"""Period as a binary fraction, so that times and limits are exact."""
HEALTHY = ChannelLimits(-1.0, 1.0, max_rate=64.0, max_age=10 * DT)
POSITIONS = {"master_position": 0, "slave_position": 1}
"""Index of the drive that moves each position."""


def limits_with(name: str = "contact_force", limits: ChannelLimits = HEALTHY) -> Limits:
    """Return wide limits of the slave, so that only channel faults occur."""
    return Limits(
        max_velocity=10.0,
        max_acceleration=1e6,
        max_master_velocity=10.0,
        max_master_acceleration=1e6,
        soft_position=(-50.0, 50.0),
        hard_position=(-90.0, 90.0),
        soft_force=50.0,
        hard_force=90.0,
        following_error=1e3,
        rest_velocity=50.0,
        rest_master_force=50.0,
        preflight=DT,
        start_ramp=DT / 4.0,
        channels=dict.fromkeys(CHANNELS, HEALTHY) | {name: limits},
    )


class Bench:
    """Runs the supervisor with working channels; the channel under test has the value `value`."""

    def __init__(self, name: str, limits: ChannelLimits = HEALTHY) -> None:
        self.name, self.limits = name, limits_with(name, limits)
        self.state, self.ticks = Supervision(), 0

    def tick(self, value=0.0, age=0.0, desired=STANDSTILL, arm=False, periods=1):
        values = dict.fromkeys(CHANNELS, (-1) ** self.ticks * 1e-3) | {self.name: value}
        ages = dict.fromkeys(CHANNELS, 0.0) | {self.name: age}
        measurement = Measurement(self.ticks * DT, **values, age=Ages(**ages))
        verdict = supervise(self.state, measurement, desired, Request(arm=arm), self.limits)
        verdict = activate(verdict) if verdict.arm else verdict
        self.state = verdict.state
        self.ticks += periods
        return verdict

    def runs(self, *args, **kwargs):
        assert self.tick(*args, **kwargs).state.mode is not Mode.FAULT

    def trips(self, fault: Fault, *args, **kwargs):
        """Run a tick, check that event and state name the fault, and return the event."""
        verdict = self.tick(*args, **kwargs)
        assert verdict.state.mode is Mode.FAULT
        (event,) = verdict.events
        assert (event.mode, event.fault, event.source) == (Mode.FAULT, fault, self.name)
        assert self.name.replace("_", " ") in event.text
        (tripped,) = verdict.state.causes
        assert (tripped.fault, tripped.source, tripped.since) == (fault, self.name, event.since)
        assert event.time == verdict.state.time == verdict.state.since
        return event


@pytest.fixture(params=CHANNELS)
def name(request):
    return request.param


def just_beyond(value: float) -> float:
    return math.nextafter(value, math.copysign(math.inf, value))


def test_not_a_number_trips(name):
    bench = Bench(name)
    bench.runs(0.5)
    event = bench.trips(Fault.NOT_A_NUMBER, math.nan)
    assert math.isnan(event.value)
    assert event.since == event.time


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinity_trips(name, value):
    bench = Bench(name)
    bench.runs(0.5)
    event = bench.trips(Fault.INFINITE, value)
    assert event.value == value
    assert event.since == event.time


def test_an_infinite_range_is_refused():
    with pytest.raises(ValueError, match="finite"):
        ChannelLimits(-math.inf, math.inf)


@pytest.mark.parametrize("first", [True, False])
def test_the_first_sample_is_checked_like_all_others(name, first):
    for fault, value, age in (
        (Fault.NOT_A_NUMBER, math.nan, 0.0),
        (Fault.INFINITE, -math.inf, 0.0),
        (Fault.OUT_OF_RANGE, 2.0, 0.0),
        (Fault.STALE, 0.0, 1.0),
    ):
        bench = Bench(name)
        if not first:
            bench.runs()
        bench.trips(fault, value, age)


@pytest.mark.parametrize("end", [1.0, -1.0])
def test_the_ends_of_the_range_are_accepted_and_a_value_just_beyond_trips(name, end):
    bench = Bench(name, ChannelLimits(-1.0, 1.0))
    bench.runs(end)
    event = bench.trips(Fault.OUT_OF_RANGE, just_beyond(end))
    assert (event.value, event.limit) == (just_beyond(end), end)
    assert event.since == event.time


def test_the_greatest_age_is_accepted_and_a_sample_just_older_trips(name):
    bench = Bench(name)
    bench.runs(0.1, age=HEALTHY.max_age)
    age = just_beyond(HEALTHY.max_age)
    event = bench.trips(Fault.STALE, 0.1, age)
    assert (event.value, event.limit) == (age, HEALTHY.max_age)
    assert event.since == pytest.approx(event.time - age)


@pytest.mark.parametrize("age", [math.nan, math.inf])
def test_an_age_that_is_not_a_number_is_stale(name, age):
    bench = Bench(name)
    bench.runs(0.1)
    bench.trips(Fault.STALE, 0.1, age)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_fastest_change_is_accepted_and_one_just_faster_trips(name, sign):
    possible = 64.0 * DT
    bench = Bench(name)
    bench.runs(0.0)
    bench.runs(sign * possible)
    bench.runs(0.0)
    event = bench.trips(Fault.JUMP, sign * just_beyond(possible))
    assert (event.value, event.limit) == (just_beyond(possible), possible)
    assert event.since == event.time


def test_a_change_is_compared_with_the_time_between_samples_not_ticks(name):
    bench = Bench(name)
    bench.runs(0.0, periods=3)
    bench.runs(3 * 64.0 * DT)
    bench = Bench(name)
    bench.runs(0.0, age=2 * DT)
    bench.runs(3 * 64.0 * DT)
    bench = Bench(name)
    bench.runs(0.0, periods=3)
    bench.trips(Fault.JUMP, 3 * 64.0 * DT, age=DT)


def test_a_change_after_a_plateau_is_compared_with_the_last_sample(name):
    bench = Bench(name)
    for _ in range(5):
        bench.runs(0.0)
    bench.trips(Fault.JUMP, 2 * 64.0 * DT)


def test_a_change_is_checked_over_at_least_a_millisecond(name):
    bench = Bench(name)
    bench.runs(0.0)
    bench.runs(64.0 * 1e-3, age=DT)
    bench = Bench(name)
    bench.runs(0.0)
    bench.trips(Fault.JUMP, just_beyond(64.0 * 1e-3), age=DT)


def test_a_value_may_repeat_for_the_frozen_time_and_not_a_tick_longer(name):
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_time=20 * DT))
    bench.runs(0.1)
    for _ in range(21):
        bench.runs(0.2)
    event = bench.trips(Fault.FROZEN, 0.2)
    assert (event.value, event.limit, event.since) == (0.2, 20 * DT, DT)


def test_a_value_that_changes_by_one_bit_is_not_frozen(name):
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_time=5 * DT))
    for tick in range(40):
        bench.runs(0.2 if tick % 4 < 2 else just_beyond(0.2))


def test_a_sample_that_is_read_again_becomes_stale_but_not_frozen(name):
    bench = Bench(name, ChannelLimits(-1.0, 1.0, max_age=10 * DT, frozen_time=5 * DT))
    for tick in range(11):
        bench.runs(0.2, age=tick * DT)
    bench.trips(Fault.STALE, 0.2, age=11 * DT)


@pytest.mark.parametrize("name", POSITIONS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_position_may_stay_for_the_frozen_travel_of_its_own_drive_and_not_farther(name, sign):
    speeds = (0.25, 0.5)
    desired = Command(sign * speeds[0], sign * speeds[1])
    travel = 12 * speeds[POSITIONS[name]] * DT
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_travel=travel))
    for tick in range(3):
        bench.runs(0.1 + 0.01 * tick, desired=desired, arm=True)
    assert bench.state.mode is Mode.ACTIVE
    bench.runs(0.2, desired=desired)
    for _ in range(12):
        assert bench.state.applied == desired
        bench.runs(0.2, desired=desired)
    event = bench.trips(Fault.FROZEN, 0.2, desired=desired)
    assert (event.value, event.limit, event.since) == (0.2, travel, 3 * DT)


@pytest.mark.parametrize("name", POSITIONS)
def test_travel_in_both_directions_adds_up(name):
    speed = 0.5
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_travel=12 * speed * DT))
    for tick in range(4):
        bench.runs(0.01 * tick, desired=Command(speed, speed), arm=True)
    for tick in range(12):
        bench.runs(0.03, desired=Command(*2 * [speed * (-1) ** tick]))
    bench.trips(Fault.FROZEN, 0.03)


def test_a_position_that_is_read_again_is_not_frozen_for_any_travel():
    bench = Bench("slave_position", ChannelLimits(-1.0, 1.0, max_age=20 * DT, frozen_travel=DT))
    for tick in range(4):
        bench.runs(0.01 * tick, desired=Command(0.5, 0.5), arm=True)
    for tick in range(10):
        bench.runs(0.03, age=(tick + 1) * DT, desired=Command(0.5, 0.5))
    bench.trips(Fault.FROZEN, 0.03, desired=Command(0.5, 0.5))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_velocity_may_stay_for_the_commanded_change_of_it_and_not_farther(sign):
    bench = Bench("slave_velocity", ChannelLimits(-1.0, 1.0, frozen_travel=1.0))
    for _ in range(3):
        bench.runs(0.0, arm=True)
    bench.runs(0.1)
    for speed in (0.25, 0.5, 0.0, 0.0, 0.0):
        bench.runs(0.1, desired=Command(1.0, sign * speed))
    bench.runs(0.1, desired=Command(1.0, sign * 0.125))
    event = bench.trips(Fault.FROZEN, 0.1)
    assert (event.value, event.limit) == (0.1, 1.0)


@pytest.mark.parametrize("name", POSITIONS)
def test_travel_is_reset_when_the_value_changes(name):
    speed = 0.5
    desired = Command(speed, speed)
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_travel=4 * speed * DT))
    for tick in range(80):
        bench.runs(0.02 * (tick // 4 % 2), desired=desired, arm=True)
    assert bench.state.mode is Mode.ACTIVE


def test_a_channel_at_rest_is_not_frozen_by_travel(name):
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_travel=1e-9))
    for _ in range(500):
        bench.runs(0.0)


@pytest.mark.parametrize("name", ["master_force", "master_position", "slave_velocity"])
def test_a_channel_that_is_not_required_may_be_nan_at_any_age(name):
    bench = Bench(name, ChannelLimits(-1.0, 1.0, frozen_time=DT, required=False))
    for age in (0.0, math.nan, math.inf, 5.0) * 5:
        bench.runs(math.nan, age, arm=True)
    assert bench.state.mode is Mode.ACTIVE


def test_a_channel_that_is_not_required_is_checked_if_it_exists(name):
    for fault, value, age in (
        (Fault.INFINITE, math.inf, 0.0),
        (Fault.OUT_OF_RANGE, 1.5, 0.0),
        (Fault.STALE, 0.1, 1.0),
        (Fault.JUMP, 0.9, 0.0),
        (Fault.NOT_A_NUMBER, math.nan, 0.0),
    ):
        limits = ChannelLimits(-1.0, 1.0, max_rate=64.0, max_age=10 * DT, required=False)
        bench = Bench(name, limits)
        bench.runs(0.0)
        bench.trips(fault, value, age)


def test_out_of_range_is_reported_before_stale_and_stale_before_a_jump(name):
    bench = Bench(name)
    bench.runs(0.0)
    bench.trips(Fault.OUT_OF_RANGE, 1.5, 1.0)
    bench = Bench(name)
    bench.runs(0.0)
    bench.trips(Fault.STALE, 0.9, 1.0)


def test_the_first_channel_with_a_fault_is_reported():
    values = dict.fromkeys(CHANNELS, 0.0)
    for name in CHANNELS[::-1]:
        values[name] = math.nan
        measurement = Measurement(0.0, **values, age=Ages(*5 * [0.0]))
        verdict = supervise(Supervision(), measurement, STANDSTILL, Request(), limits_with())
        assert verdict.events[0].source == name


def test_each_channel_has_its_own_limits():
    """Only the channel with a narrow range has a fault."""
    for name in CHANNELS:
        bench = Bench(name, ChannelLimits(-0.1, 0.1))
        bench.runs(0.1)
        bench.trips(Fault.OUT_OF_RANGE, 0.11)
