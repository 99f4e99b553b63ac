"""Means over recordings, and their intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from teleop.evaluation.across.means import Value, mean_of, mean_tracking
from teleop.evaluation.teleoperation.tracking import Tracking


def tracked(phase=-60.0, gain=0.9, rms=2e-3, frequency=1.0):
    return Tracking(gain, phase, 0.1, rms, frequency, 1.0, 5)


def test_an_interval_beyond_the_possible_values_is_left_out():
    found = mean_tracking([tracked(-18.0, rms=1e-3), tracked(-102.0, rms=3.2e-3)])
    assert found["phase_deg"].value == pytest.approx(-60.0)
    assert found["rms_m"].value == pytest.approx(2.1e-3)
    assert math.isnan(found["phase_deg"].half)
    assert math.isnan(found["rms_m"].half)
    assert found["gain"].half == 0.0


def test_the_interval_of_similar_recordings_is_that_of_students_t():
    phases = [-60.0, -62.0, -64.0]
    mean = mean_tracking([tracked(phase) for phase in phases])["phase_deg"]
    half = 4.3027 * np.std(phases, ddof=1) / math.sqrt(3.0)
    assert mean == pytest.approx((-62.0, half, 3), rel=1e-4)


def test_repetitions_of_a_subject_are_one_observation():
    gains = [1.0, 1.0, 1.0, 0.7, 0.8, 0.6]
    alone = mean_tracking([tracked(gain=gain) for gain in gains])["gain"]
    found = mean_tracking([tracked(gain=gain) for gain in gains], [*"aaabbc"])["gain"]
    means = [1.0, 0.75, 0.6]
    half = 4.3027 * np.std(means, ddof=1) / math.sqrt(3.0)
    assert found == pytest.approx((np.mean(means), half, 6), rel=1e-4)
    assert found.half > 2.0 * alone.half
    values = [Value(gain, 0.2, "") for gain in gains]
    assert mean_of(values, [*"aaabbc"]).half == pytest.approx(math.hypot(half, 0.2), rel=1e-4)


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=6), st.floats(-270.0, 90.0))
def test_the_mean_phase_turns_with_the_phases(deviations, turn):
    def wrapped(phase):
        return (phase - 90.0) % -360.0 + 90.0

    assume(abs(wrapped(turn) - 90.0) > 1e-6)
    plain = mean_tracking([tracked(one) for one in deviations])["phase_deg"]
    turned = mean_tracking([tracked(wrapped(one + turn)) for one in deviations])["phase_deg"]
    distance = (turned.value - plain.value - turn + 180.0) % 360.0 - 180.0
    assert abs(distance) < 1e-6
    assert -270.0 < turned.value <= 90.0 + 1e-9
    assert turned.half == pytest.approx(plain.half, abs=1e-6, nan_ok=True)


recordings = st.lists(
    st.tuples(st.floats(-1e6, 1e6), st.floats(0.0, 1e6)), min_size=1, max_size=8
).map(lambda pairs: [Value(value, half, "") for value, half in pairs])


@given(recordings)
def test_the_interval_of_a_mean_is_not_narrower_than_those_of_its_recordings(values):
    mean = mean_of(values)
    assert mean.half >= np.mean([one.half for one in values]) * (1.0 - 1e-12)


@given(recordings)
def test_the_mean_of_values_that_are_not_resolved_is_not_resolved(values):
    wide = [one._replace(half=max(one.half, abs(one.value))) for one in values]
    mean = mean_of(wide)
    assert mean.half >= abs(mean.value) * (1.0 - 1e-12)


def test_the_interval_of_a_mean_contains_the_spread_and_the_intervals_of_its_recordings():
    values = [Value(value, 6.3, "") for value in (3.8, 3.88, 3.96)]
    spread = 4.3027 * 0.08 / math.sqrt(3.0)
    assert mean_of(values) == pytest.approx((3.88, math.hypot(spread, 6.3), 3), rel=1e-4)


def test_without_intervals_of_the_recordings_the_interval_of_a_mean_is_that_of_the_spread():
    values = [Value(value, math.nan, "") for value in (3.8, 3.88, 3.96)]
    assert mean_of(values).half == pytest.approx(4.3027 * 0.08 / math.sqrt(3.0), rel=1e-4)
    assert math.isnan(mean_of(values[:1]).half)
