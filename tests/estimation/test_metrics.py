from __future__ import annotations

import math

import numpy as np
import pytest

from estimation import (
    Estimates,
    Regression,
    coverage,
    estimated_force,
    force_error,
    least_squares,
    predicted_force,
    rise_time,
)


def test_force_error_is_the_mean_of_the_absolute_error():
    assert force_error([1.0, -2.0, 3.0], [2.0, -2.0, 1.0]) == 1.0


def test_estimated_force_uses_the_present_estimate_and_prediction_the_previous_one():
    unknown = np.full(2, np.nan)
    estimates = Estimates(
        np.array([1.0, 2.0]), np.array([10.0, 20.0]), unknown, unknown, np.zeros(2, bool)
    )
    x, v = np.array([0.5, 0.25]), np.array([1.0, -1.0])
    regression = Regression(x, v, np.zeros(2), np.ones(2), np.empty((2, 0)))
    assert list(estimated_force(regression, estimates)) == [6.0, 3.0]
    assert list(predicted_force(regression, estimates)) == [0.0, 1.5]


def test_coverage_counts_only_samples_whose_standard_deviation_is_known():
    std = [1.0, 1.0, 1.0, math.nan, 1e12]
    assert coverage([1.9, -1.9, 2.1, 0.0, 0.0], std, 0.0) == 2.0 / 3.0
    assert math.isnan(coverage([0.0, 0.0], [math.nan, 1e12], 0.0))


def test_rise_time_of_a_first_order_lag_is_its_time_constant_times_log_9():
    t = np.linspace(0.0, 50.0, 500_001)
    assert rise_time(t, 1.0 - np.exp(-t / 0.2)) == pytest.approx(0.2 * math.log(9.0), rel=0.02)


def test_rise_time_ignores_a_rest_before_and_is_zero_for_a_jump():
    t = np.arange(1000) * 1e-3
    assert rise_time(t, np.where(t < 0.3, 0.0, 2000.0)) == 0.0


def test_rise_time_of_an_estimate_that_never_rises_is_nan():
    t = np.arange(10.0)
    assert math.isnan(rise_time(t, np.zeros(10)))
    assert math.isnan(rise_time([], []))


def test_least_squares_equals_the_normal_equations(palpation):
    s = palpation(noise=0.3)
    regressors = np.column_stack((s.v, s.x))
    expected = np.linalg.solve(regressors.T @ regressors, regressors.T @ s.f)
    fit = least_squares(s.x, s.v, s.f)
    np.testing.assert_allclose((fit.b, fit.k), expected, rtol=1e-9)
    assert fit.rms == pytest.approx(0.3, rel=0.1)


def test_least_squares_of_a_hold_does_not_determine_damping():
    fit = least_squares(np.full(5, 2e-3), np.zeros(5), np.full(5, 4.0))
    assert fit.b == 0.0
    assert fit.k == pytest.approx(2000.0)
