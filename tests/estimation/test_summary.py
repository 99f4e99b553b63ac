"""Summary of the estimates over a record."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from estimation import Regression, scaled_preset
from estimation.summary import summarise


def record(seconds=4.0):
    t = np.arange(0.0, seconds, 1e-3)
    x, v = 4e-3 - 3e-3 * np.cos(6.0 * t), 18e-3 * np.sin(6.0 * t)
    f = 800.0 * x + 5.0 * v + np.random.default_rng(0).normal(0.0, 0.01, t.size)
    return t, Regression(x, v, f, np.full(t.size, 1e-3), np.empty((t.size, 0)))


def summary(estimator, t, regression):
    bank = replace(scaled_preset(*regression[:4]), estimators=(estimator,)).bank()
    estimates = bank.run(*regression)[estimator]
    return summarise(t, regression, estimates, bank[estimator], np.zeros(t.size))


def test_averages_leave_out_the_samples_before_the_first_estimate():
    t, regression = record()
    found = summary("segments", t, regression)
    assert found.k == pytest.approx(800.0, rel=0.01)
    assert found.b == pytest.approx(5.0, abs=1.0)
    assert found.e_f < 0.05
    assert found.one_step_rms < 0.05


def test_an_estimator_that_never_has_an_estimate_has_no_average():
    t, regression = record(0.2)
    found = summary("segments", t, regression)
    assert found.held == 1.0
    assert all(math.isnan(value) for value in (found.k, found.b, found.e_f, found.one_step_rms))
