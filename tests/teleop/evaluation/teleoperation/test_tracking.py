"""Tracking of a sinusoidal target: gain, delay, frequency."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.control.target import Target
from teleop.evaluation.teleoperation.tracking import tracking
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

T = np.arange(0.0, 12.0, 1e-3)


def target_of(target, t=T):
    return np.array([target.position(time) for time in t])


@pytest.fixture(scope="module")
def recorded():
    """Time and target of a recorded trial with a count-in."""
    settings = TrialSettings("mimic", clock="virtual", estimators=("rls",), count_in=2.0)
    recording = run_trial(settings).recording
    return recording["time"], recording["target"], settings.target


@pytest.mark.parametrize(
    ("gain", "delay"), [(0.5, -0.1), (1.3, 0.05), (0.9, 0.25), (0.5, 0.6), (1.3, 0.6)]
)
def test_gain_and_delay_of_an_operator_are_recovered_from_the_recorded_target(
    recorded, gain, delay
):
    t, target, exact = recorded
    noise = np.random.default_rng(1).normal(0.0, 2e-4, len(t))
    found = tracking(t, target, gain * target_of(exact, t - delay) + noise, exact.frequency)
    assert found.gain == pytest.approx(gain, rel=0.05)
    assert found.delay_s == pytest.approx(delay, rel=0.05)
    assert found.frequency_hz == pytest.approx(exact.frequency, rel=0.01)
    assert found.phase_deg == pytest.approx(-360.0 * delay * exact.frequency, rel=0.05)


@given(
    frequency=st.floats(0.3, 3.0),
    gain=st.floats(0.2, 2.0),
    cycles=st.floats(-0.2, 0.7),
    count_in=st.floats(0.0, 4.0),
)
def test_gain_and_delay_are_recovered_at_any_frequency(frequency, gain, cycles, count_in):
    target = Target(frequency, 5e-3, count_in)
    position = gain * target_of(target, T - cycles / frequency)
    found = tracking(T, target_of(target), position, frequency)
    assert found.gain == pytest.approx(gain, rel=0.05)
    assert found.delay_s * frequency == pytest.approx(cycles, abs=0.05 * abs(cycles) + 0.002)


@pytest.mark.parametrize("achieved", [0.7, 1.0, 1.4])
def test_the_frequency_that_was_achieved_is_found(achieved):
    position = target_of(Target(achieved, 5e-3))
    found = tracking(T, target_of(Target(1.0, 5e-3)), position, 1.0)
    assert found.frequency_hz == pytest.approx(achieved, rel=0.005)


def test_the_error_is_the_root_mean_square_of_the_difference():
    target = target_of(Target(1.0, 5e-3))
    found = tracking(T, target, target + 1e-3, 1.0)
    assert found.rms_m == pytest.approx(1e-3)
    assert (found.gain, found.delay_s) == pytest.approx((1.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("end", [0.0, 3.0, 4.0])
def test_without_enough_periods_there_is_no_tracking(end):
    t = T[end >= T]
    target = target_of(Target(1.0, 5e-3, count_in=3.0), t)
    assert tracking(t, target, target, 1.0) is None
    assert tracking(t, np.full(len(t), math.nan), target, 1.0) is None


def test_ticks_before_and_after_the_target_are_left_out():
    target = target_of(Target(1.0, 5e-3))
    cut = target.copy()
    cut[:1000] = cut[-500:] = math.nan
    assert tracking(T, cut, target, 1.0).rms_m == 0.0
