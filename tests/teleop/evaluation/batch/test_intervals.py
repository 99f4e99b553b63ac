"""The intervals hold at the ends of a record, for a coarse encoder, for holds, for few samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.robust_error import robust_fit
from estimation.smoothing import slope, smooth
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings

K = 2000.0


def sine(frequency: float, rate: float, samples: int, noise: float = 0.01, seed: int = 0):
    """Return a sine about a preload on a Kelvin-Voigt body, whose loss is a tenth of k."""
    t = np.arange(samples) / rate
    w = 2.0 * np.pi * frequency
    x = 3e-3 + 1e-3 * np.sin(w * t - 1.0)
    f = 5.0 + K * x + 0.1 * K * 1e-3 * np.cos(w * t - 1.0)
    return t, x, f + np.random.default_rng(seed).normal(0.0, noise, samples)


def signals(t, x, f) -> Signals:
    return Signals(t, x, f, periods(t), "position")


def result(t, x, f) -> StiffnessResult:
    return analyse(signals(t, x, f)).result


@pytest.mark.parametrize("seed", range(5))
def test_a_fast_motion_at_a_low_rate_is_not_spoiled_by_the_ends_of_the_record(seed):
    found = result(*sine(6.0, 100.0, 200, seed=seed))
    assert found.k == pytest.approx(K, rel=5e-3)
    assert found.k_high - found.k_low < 0.02 * K


@settings(max_examples=10, deadline=None)
@given(count=st.floats(1e-5, 1e-4), start=st.floats(0.0, 1e-4), frequency=st.floats(0.5, 2.0))
def test_the_error_with_a_coarse_encoder_is_within_three_deviations(count, start, frequency):
    t, x, f = sine(frequency, 200.0, 2000)
    found = result(t, np.round((x + start) / count) * count, f)
    assert abs(found.k - K) < 1.6 * 0.5 * (found.k_high - found.k_low)


@pytest.mark.parametrize("count", [2e-5, 5e-5])
@pytest.mark.parametrize("seed", range(3))
def test_the_interval_contains_k_with_an_encoder_whose_counts_repeat_in_each_cycle(count, seed):
    t, x, f = sine(1.0, 200.0, 2000, seed=seed)
    found = result(t, np.round(x / count) * count, f)
    assert found.k_low <= K <= found.k_high


@pytest.mark.parametrize("hold", [5.0, 40.0])
def test_a_ramp_with_a_long_hold_gives_a_stiffness(hold):
    t = np.arange(round(100.0 * (2.0 + hold))) / 100.0
    x = 1e-3 * np.clip(t - 0.5, 0.0, 1.0)
    found = result(t, x, K * x + np.random.default_rng(0).normal(0.0, 2e-3, len(t)))
    assert found.k == pytest.approx(K, rel=0.02)


def test_few_samples_are_a_remark():
    found = result(*sine(2.0, 100.0, 50))
    assert any("few samples" in reason for reason in found.reasons)
    assert not any("few samples" in reason for reason in result(*sine(2.0, 100.0, 500)).reasons)


def test_noise_that_hides_the_damping_is_a_remark_whatever_the_datum_is():
    def reasons(mean: float, loss: float) -> list[str]:
        """Return the reasons for a datum that is `mean` [mm] above the mean position."""
        t, x, f = sine(1.0, 200.0, 2000, noise=0.05)
        f += (loss - 0.1) * K * 1e-3 * np.cos(2.0 * np.pi * t - 1.0)
        datum = EstimateSettings(datum=f"{3.0 - mean}mm,{11.0 - 2.0 * mean}N")
        return evaluate(signals(t, x, f), datum).batch_summary()["result"]["reasons"]

    assert any("do not determine b" in reason for reason in reasons(0.0, 1e-3))
    assert not any("do not determine" in reason for reason in reasons(20.0, 0.1))


def test_a_damping_that_the_result_resolves_is_determined_also_where_the_online_model_is_wrong():
    """The expected interval is that of a constant stiffness; what it leaves counts as noise."""
    evaluation = evaluate(signals(*sine(1.0, 200.0, 2000)), EstimateSettings())
    wide = evaluation.online.expected._replace(b=1.4)
    evaluation = replace(evaluation, online=evaluation.online._replace(expected=wide))
    found = evaluation.batch_summary()["result"]
    assert found["b_low"] > 0.0
    assert not any("do not determine" in reason for reason in found["reasons"])


@pytest.mark.parametrize("width", [1.0, 4.0, 8.0])
@pytest.mark.parametrize("turn", [0.2, 1.0])
def test_the_slope_of_a_smoothed_sine_is_the_derivative_of_the_smoothed_sine(width, turn):
    w = turn / width
    n = np.arange(2000.0)
    inside = slice(200, -200)
    found = slope(np.sin(w * n), width, 1.0)[inside]
    expected = w * smooth(np.cos(w * n), width)[inside]
    np.testing.assert_allclose(found, expected, atol=2e-5 * w)


def test_the_variance_counts_the_leverage_of_few_samples_that_determine_a_parameter():
    rng = np.random.default_rng(0)
    regressors = np.column_stack([np.ones(60), np.linspace(-1.0, 1.0, 60), np.zeros(60)])
    regressors[:2, 2] = 1.0
    fits = [robust_fit(regressors, rng.normal(0.0, 1.0, 60)) for _ in range(400)]
    variance = np.var([fit.theta[2] for fit in fits])
    white = [np.sum(f.inverse[2] ** 2 * f.residual**2 / (1.0 - f.leverage)) for f in fits]
    assert np.mean(white) == pytest.approx(variance, rel=0.15)
    deviations = [fit.deviation(np.array([0.0, 0.0, 1.0])) for fit in fits]
    assert np.mean(deviations) > 0.6 * np.sqrt(variance)
