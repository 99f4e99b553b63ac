"""A lag of the force in a motion of several frequencies is not taken for relaxation."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.testing_records import relaxed
from estimation.transmission import TransmissionCalibration, stated_lag
from teleop.evaluation.batch.analysis import Analysis, analyse
from teleop.evaluation.reading.signals import Signals, periods

RATE = 500.0
T = np.arange(0.0, 20.0, 1.0 / RATE)
TONES = ((0.4, 0.0), (1.1, 1.3), (2.3, 2.9), (3.7, 4.0))


def position(t: np.ndarray) -> np.ndarray:
    return 5e-3 + sum(8e-4 * np.sin(2.0 * np.pi * f * t + p) for f, p in TONES)


def analysed(f: np.ndarray, lag: float = 0.0) -> Analysis:
    f = f + np.random.default_rng(0).normal(0.0, 0.01, len(T))
    record = Signals(T, position(T), f, periods(T), "position")
    return analyse(record, TransmissionCalibration(force_lag=lag))


@pytest.mark.parametrize("stated", [0.0, 3e-3])
def test_a_lag_is_found_instead_of_a_relaxation(stated):
    at = T - 9e-3
    found = analysed(500.0 * position(at) + 9.0 * np.gradient(position(at), T), stated)
    assert found.local.best.times
    assert found.local.lag.seconds == pytest.approx(9e-3 - stated, rel=0.08)
    result = found.result
    assert result.k_low < 500.0 < result.k_high
    assert result.b is None
    assert "lags behind" in result.b_reason
    assert ("besides the compensated lag" in result.b_reason) == bool(stated)
    assert not result.times
    assert not any("relaxes" in reason for reason in result.reasons)


@pytest.mark.parametrize("time", [0.02, 0.1])
def test_a_relaxation_is_not_taken_for_a_lag(time):
    x = position(T)
    found = analysed(500.0 * x + 400.0 * relaxed(x, RATE, time) + 2.0 * np.gradient(x, T))
    assert found.local.lag is None
    assert found.local.best.times == pytest.approx((time,), rel=0.05)


def test_a_noisy_ramp_that_needs_no_relaxation_has_no_lag():
    """Noise alone gives a relaxation and a lag of a ramp a likelihood that is a little larger."""
    t = np.arange(0.0, 12.0, 1.0 / 349.0)
    x = 8e-4 * np.interp(t, [0.0, 0.6, 6.0, 11.4, 12.0], [-0.1, -0.1, 1.0, -0.1, -0.1])
    f = 2e4 * np.maximum(x, 0.0) + np.random.default_rng(75).normal(0.0, 0.06, len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert found.local.best.times
    assert found.local.lag is None
    assert not any("lags behind" in reason for reason in found.result.reasons)


def test_the_form_of_a_long_stated_lag_is_that_which_the_record_shows():
    """Between the forms, the force of a pure delay looks like that of a relaxing body."""
    at = T - 20e-3
    f = 500.0 * position(at) + 4.0 * np.gradient(position(at), T)
    f += np.random.default_rng(0).normal(0.0, 0.01, len(T))
    known = stated_lag(TransmissionCalibration(), 20e-3)
    found = analyse(Signals(T, position(T), f, periods(T), "position"), known)
    assert found.transmission.delay_share == 1.0
    assert found.result.b == pytest.approx(4.0, rel=0.03)
    assert found.result.k == pytest.approx(500.0, rel=5e-3)
