from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.methods.normalised_identification import NormalisedIdentification
from estimation.model import WITH_DATUM

SIZES = (0.025, 5e-3)


def test_equals_an_ode_solver_on_the_law_with_running_mean_squares():
    rate, memory, dt = 11.0, 0.05, 5e-5

    def regressors(t):
        x = 5e-3 + 3e-3 * np.sin(19.0 * t)
        return np.array([57e-3 * np.cos(19.0 * t), x])

    def flow(t, y):
        theta, mean = y[:2], y[2:]
        phi = regressors(t)
        gain = rate / np.maximum(mean, 0.1 * np.square(SIZES))
        return np.concatenate(
            (gain * phi * (phi @ (np.array([20.0, 2100.0]) - theta)), (phi**2 - mean) / memory)
        )

    solution = solve_ivp(flow, (0.0, 0.3), [0.0, 0.0, *np.square(SIZES)], rtol=1e-8, atol=1e-10)
    t = dt * np.arange(1, 6001)
    v, x = regressors(t)
    estimates = NormalisedIdentification(rate, SIZES, memory).run(x, v, 20.0 * v + 2100.0 * x, dt)
    np.testing.assert_allclose(estimates.k[-1], solution.y[1, -1], rtol=1e-3)
    np.testing.assert_allclose(estimates.b[-1], solution.y[0, -1], rtol=1e-3)


@given(power=st.integers(-20, 20), seed=st.integers(0, 100))
def test_units_do_not_matter(power, seed):
    rng = np.random.default_rng(seed)
    x, v, f = 5e-3 * rng.normal(size=(3, 20))
    scale = 2.0**power
    plain = NormalisedIdentification(11.0, SIZES).run(x, v, f, 1e-3)
    scaled = NormalisedIdentification(11.0, (SIZES[0], SIZES[1] * scale)).run(x * scale, v, f, 1e-3)
    np.testing.assert_array_equal(plain.b, scaled.b)
    np.testing.assert_array_equal(plain.k, scaled.k * scale)


@pytest.mark.parametrize("k", [2000.0, 5000.0, 30000.0])
@pytest.mark.parametrize("depth", [2e-3, 5e-3, 10e-3])
def test_one_rate_is_suitable_for_all_cubes_and_depths(depth, k):
    t = 1e-3 * np.arange(1000)
    x = depth * (1.0 + 0.6 * np.sin(19.0 * t))
    v = depth * 0.6 * 19.0 * np.cos(19.0 * t)
    estimates = NormalisedIdentification(11.0, SIZES).run(x, v, 20.0 * v + k * x, 1e-3)
    assert estimates.k[-1] == pytest.approx(k, rel=0.01)


@given(rate=st.floats(1e-3, 1e9), dt=st.floats(1e-5, 1e5))
def test_a_steady_motion_is_stable_for_every_rate_and_period(rate, dt):
    estimator = NormalisedIdentification(rate, SIZES)
    x, v = 5e-3, 0.025  # mean squares stay as they are, and with them the metric of the law
    error = math.inf
    for n in range(40):
        sign = 1.0 if n % 3 else -1.0
        estimate = estimator.update(x, sign * v, sign * 20.0 * v + 2000.0 * x, dt)
        after = math.hypot((estimate.b - 20.0) * v, (estimate.k - 2000.0) * x)
        assert after <= error * (1.0 + 1e-9) + 1e-9
        error = after


def test_the_interval_has_its_nominal_coverage_of_the_plant(palpation):
    inside = []
    for seed in range(30):
        estimator = NormalisedIdentification(20.0, SIZES)
        estimator.run(*palpation(seconds=3.0, noise=0.5, seed=seed))
        b, k, b_std, k_std, *_ = estimator.estimate
        inside += [abs(b - 20.0) < 1.96 * b_std, abs(k - 2100.0) < 1.96 * k_std]
    assert 0.85 < np.mean(inside) <= 1.0
    assert k_std < 20.0


def test_an_outlier_does_not_reduce_the_gain(palpation):
    s = palpation()
    estimator = NormalisedIdentification(11.0, SIZES)
    estimator.update(1e6, 1e6, 0.0, 1e-3)
    estimator.run(*s)
    assert estimator.estimate.k == pytest.approx(2100.0, rel=0.01)


@pytest.mark.usefixtures("interpreted")
def test_further_regressors_are_estimated_too(palpation):
    s = palpation(seconds=3.0)
    x = s.x - 5e-3
    estimator = NormalisedIdentification(11.0, (*SIZES, 1.0), model=WITH_DATUM)
    estimates = estimator.run(x, s.v, s.f - 2100.0 * 5e-3 + 3.0, s.dt, np.ones((len(x), 1)))
    assert estimates.k[-1] == pytest.approx(2100.0, rel=0.01)
    assert estimates.further["f0"].value[-1] == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, SIZES), "rate"),
        ((math.nan, SIZES), "rate"),
        ((1.0, (1.0,)), "sizes"),
        ((1.0, (1.0, 0.0)), "sizes"),
        ((1.0, SIZES, 0.0), "memory"),
        ((1.0, SIZES, math.inf), "memory"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        NormalisedIdentification(*arguments)
