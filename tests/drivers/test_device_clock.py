"""The device clock with simulated data: latency, periodic reading, delays, drift and wrap."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.device_clock import DRIFT, WRAP, DeviceClock

TICK = 1e-3


def run(seed=1, *, seconds=2.0, drift=0.0, start=0, latency=0.2e-3, jitter=0.0, stalls=(), slow=()):
    """Return the errors of the newest sample's time at each reading [s]: converted minus true.

    `stalls` are times at which the controller sleeps for 60 ms, and the device for the first 55 of
    them; `slow` is a span in which all deliveries take 30 ms more.
    """
    random_ = random.Random(seed)
    clock, errors = DeviceClock(), []
    due = [0.0137 + TICK * i for i in range(int(seconds / TICK))]
    taken = [t for t in due if not any(0.0 <= t - stall < 0.055 for stall in stalls)]
    arrivals = []
    last = 0.0
    for t in taken:
        extra = 0.03 if slow and slow[0] <= t < slow[1] else 0.0
        last = max(last, t + latency + extra + random_.expovariate(1.0) * jitter)
        arrivals.append(last)
    stalls = list(stalls)
    drained = before = 0.0
    i = 0
    while i < len(taken):
        if stalls and drained >= stalls[0]:
            stalls.pop(0)
            drained += 0.06
        drained += TICK * random_.uniform(0.7, 1.3)
        first = i
        while i < len(taken) and arrivals[i] <= drained:
            i += 1
        if i > first:
            stamp = (start + round(taken[i - 1] * 1e6 * (1.0 + drift))) % WRAP
            clock.observe(stamp, 0.5 * (before + drained))
            errors.append(clock.time(stamp) - taken[i - 1])
        before = drained
    return errors


@given(
    st.integers(0, 10**6),
    st.floats(-DRIFT, DRIFT),
    st.integers(0, WRAP - 1),
    st.floats(0.0, 0.5e-3),
    st.floats(0.0, 1e-3),
)
def test_a_time_is_never_too_early_and_too_late_by_the_least_age(
    seed, drift, start, latency, jitter
):
    errors = run(seed, seconds=0.5, drift=drift, start=start, latency=latency, jitter=jitter)[100:]
    assert min(errors) > -0.1e-3
    assert max(errors) < latency + 1.5e-3


def test_the_counter_of_the_device_wraps_without_a_jump():
    smooth, wrapped = run(seconds=1.0), run(seconds=1.0, start=WRAP - 500_000)
    assert wrapped == pytest.approx(smooth, abs=1e-5)


@pytest.mark.parametrize("drift", [DRIFT, -DRIFT])
def test_the_drift_of_two_crystals_is_followed(drift):
    errors = run(seconds=20.0, drift=drift, jitter=0.2e-3)[100:]
    assert min(errors) > -0.1e-3
    assert max(errors) < 1e-3


def test_a_delay_of_both_controller_and_device_does_not_increase_ages():
    errors = run(stalls=[0.5, 0.9, 1.3])[100:]
    assert min(errors) > -1e-6
    assert max(errors) < 1e-3


def test_a_late_delivery_increases_the_age():
    errors = run(seconds=3.0, slow=(1.0, 2.0))[100:]
    assert min(errors) > -1e-6
    assert max(errors) < 1e-3


def test_an_older_stamp_is_mapped_to_the_past_across_the_wrap():
    clock = DeviceClock()
    clock.observe(500, 2.0)
    assert clock.time(WRAP - 500) == pytest.approx(2.0 - 1e-3)


def test_nothing_is_known_before_the_first_sample():
    assert math.isnan(DeviceClock().time(5))


def test_a_repeated_time_is_accepted():
    clock = DeviceClock()
    for stamp, now in ((1000, 5.0), (2000, 5.001), (3000, 4.0)):
        clock.observe(stamp, now)
    assert clock.time(3000) == pytest.approx(4.0, abs=1e-3)
