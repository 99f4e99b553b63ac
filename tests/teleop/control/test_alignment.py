"""Pairs of position and force at the same time, from sensors with different sampling times."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Ages, Measurement
from teleop.control.alignment import Alignment


def measure(now, position_age=0.0, force_age=0.0, x=math.sin, f=math.cos):
    """Return the measurement of a motion x(t) and a force f(t) with samples of these ages [s]."""
    return Measurement(
        now,
        0.0,
        0.0,
        x(now - position_age),
        f(now - force_age),
        0.0,
        Ages(0.0, 0.0, position_age, force_age, 0.0),
    )


def pairs(measurements):
    alignment, before, found = Alignment(), None, []
    for m in measurements:
        pair = alignment.update(m, m.time - before if before is not None else 1e-3)
        before = m.time
        if pair:
            found.append(pair)
    return found


def test_samples_of_the_same_time_are_paired_unchanged():
    times = [0.1, 0.101, 0.1025, 0.104]
    found = pairs(measure(t) for t in times)
    assert [p.position for p in found] == [math.sin(t) for t in times]
    assert [p.force for p in found] == [math.cos(t) for t in times]
    assert [p.dt for p in found] == [1e-3] + [b - a for a, b in pairwise(times)]


def test_a_force_that_lags_is_paired_with_the_position_at_its_sampling_time():
    line = lambda t: 3.0 * t  # noqa: E731
    found = pairs(measure(1e-3 * n, force_age=3.4e-3, x=line) for n in range(40))
    for n, pair in enumerate(found[4:], start=4):
        assert pair.position == pytest.approx(3.0 * (1e-3 * n - 3.4e-3), abs=1e-12)
        assert pair.force == math.cos(1e-3 * n - 3.4e-3)


def test_a_force_waits_for_a_position_that_lags():
    line = lambda t: 3.0 * t  # noqa: E731
    ramp = lambda t: -5.0 * t  # noqa: E731
    found = pairs(measure(1e-3 * n, position_age=0.7e-3, x=line, f=ramp) for n in range(40))
    assert len(found) == 39
    for pair in found[1:]:
        assert pair.force / pair.position == pytest.approx(-5.0 / 3.0)


def test_a_slow_force_sensor_gives_a_pair_for_each_of_its_samples():
    held = [measure(1e-3 * n, force_age=1e-3 * (n % 10)) for n in range(100)]
    found = pairs(held)
    assert len(found) == 10
    assert [p.dt for p in found[1:]] == pytest.approx([10e-3] * 9)


def test_a_slow_encoder_gives_interpolated_pairs_only_up_to_its_newest_sample():
    line = lambda t: 3.0 * t  # noqa: E731
    held = [measure(1e-3 * n, position_age=1e-3 * (n % 10), x=line) for n in range(100)]
    for pair in pairs(held)[1:]:
        assert pair.position == pytest.approx(3.0 * math.acos(pair.force), abs=1e-6)


AGE = st.floats(0.0, 5e-3)


@given(st.lists(st.tuples(AGE, AGE), min_size=2, max_size=60))
def test_pairs_of_a_linear_motion_are_on_the_line_and_time_increases(ages):
    line = lambda t: 3.0 * t  # noqa: E731
    held = [measure(1e-3 * n, p, q, x=line, f=lambda t: t) for n, (p, q) in enumerate(ages)]
    first = min(m.time - m.age.slave_position for m in held)
    for pair in pairs(held):
        assert pair.dt > 0.0
        if pair.force >= max(first, held[0].time - held[0].age.slave_position):
            assert pair.position == pytest.approx(3.0 * pair.force, abs=1e-5)
