"""Means over recordings, and their intervals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from teleop.evaluation.means import mean_tracking
from teleop.evaluation.tracking import Tracking


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
