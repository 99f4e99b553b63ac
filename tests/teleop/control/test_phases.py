"""The reference of each step is continuous, and its rate is the derivative of its value."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.control.phases import (
    Approach,
    Cyclic,
    Hold,
    Preload,
    Ramp,
    RampHoldRelease,
    Random,
    Staircase,
    Sweep,
    Withdraw,
)

POSITIVE = st.floats(0.05, 3.0)
PHASES = st.one_of(
    st.builds(Approach, POSITIVE, st.floats(1e-3, 5e-3)),
    st.builds(Ramp, depth=POSITIVE, time=POSITIVE),
    st.builds(Ramp, force=POSITIVE, speed=POSITIVE),
    st.builds(Hold, POSITIVE),
    st.builds(Preload, force=POSITIVE, ramp=POSITIVE, hold=POSITIVE),
    st.builds(RampHoldRelease, depth=POSITIVE, ramp=POSITIVE, hold=POSITIVE, rest=POSITIVE),
    st.builds(Staircase, depths=st.tuples(POSITIVE, POSITIVE), ramp=POSITIVE, hold=POSITIVE),
    st.builds(Cyclic, depth=POSITIVE, frequencies=st.tuples(POSITIVE, POSITIVE), cycles=st.just(3)),
    st.builds(Sweep, depth=POSITIVE, low=st.just(0.2), high=POSITIVE.map(lambda f: 0.3 + f)),
    st.builds(Random, depth=POSITIVE, duration=POSITIVE, seed=st.integers(0, 99)),
    st.builds(Withdraw, POSITIVE),
)


@given(PHASES, st.floats(-1.0, 1.0), st.floats(0.0, 1.0))
def test_the_rate_is_the_derivative_of_the_value(phase, start, share):
    for step in phase.steps(1):
        duration = step.duration(start)
        h = 1e-6 * max(duration, 1e-3)
        t = h + share * max(duration - 2.0 * h, 0.0)
        low, now, high = (step.reference(t + shift, start) for shift in (-h, 0.0, h))
        slope = (high.value - low.value) / (2.0 * h)
        size = 1.0 + max(abs(now.rate), abs(now.value) / max(duration, 1e-3))
        assert abs(slope - now.rate) < 1e-3 * size


@given(PHASES, st.floats(-1.0, 1.0))
def test_each_step_begins_where_the_last_one_ended_and_ends_at_rest(phase, start):
    value, by = start, None
    for step in phase.steps(1):
        if by not in (None, step.by):
            return
        begin = step.reference(0.0, value)
        end = step.reference(step.duration(value), value)
        assert begin.value == pytest.approx(value, abs=1e-9) or step.kind in ("cyclic", "random")
        if step.kind != "approach":
            assert abs(begin.rate) < 1e-9
            assert abs(end.rate) < 1e-9
        value, by = end.value, step.by


def test_a_random_motion_reaches_its_amplitude_and_does_not_exceed_it():
    step = [*Random(depth=1e-3, amplitude=2e-4, duration=10.0, seed=5).steps(1)][-1]
    values = [step.reference(0.002 * n, 0.0).value - 1e-3 for n in range(5000)]
    assert 1.5e-4 < max(map(abs, values)) < 2.05e-4


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: Ramp(depth=1e-3, force=2.0, time=1.0), "either depth or force"),
        (lambda: Ramp(depth=1e-3), "either time or speed"),
        (lambda: Preload(force=-1.0), "force: expected more than 0"),
        (lambda: Cyclic(depth=1e-3, frequencies=()), "at least one"),
        (lambda: Cyclic(depth=1e-3, frequencies=(1.0, -1.0)), "more than 0"),
        (lambda: Sweep(depth=1e-3, low=2.0, high=1.0), "low < high"),
        (lambda: Cyclic(force=1.0), "amplitude: is missing"),
        (lambda: Cyclic(force=1.0, amplitude=1.0), "expected less than force"),
        (lambda: Staircase(), "either depths or forces"),
        (lambda: Hold(duration=math.inf), "finite"),
        (lambda: RampHoldRelease(depth=1e-3, rest=-1.0), "rest: expected at least 0"),
    ],
)
def test_values_that_make_no_phase_are_refused(make, expected):
    with pytest.raises(ValueError, match=expected):
        make()
