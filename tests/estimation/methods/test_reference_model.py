from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.methods.reference_model import ReferenceModel

SIZES = np.array([0.025, 5e-3])
FLOOR = 0.02
PLANT = np.array([20.0, 2100.0])


def regressors(t):
    return np.array([57e-3 * np.cos(19.0 * t), 5e-3 + 3e-3 * np.sin(19.0 * t)])


def flow(t, y, rate, a):
    """Derivatives of the lagged force, of the lagged model, and of theta."""
    reference, model, theta = y[0], y[1], y[2:]
    phi = regressors(t)
    n = math.sqrt(FLOOR + phi @ (phi / SIZES**2))
    return np.array(
        [
            a * (phi @ PLANT / n - reference),
            a * (phi @ theta / n - model),
            *(rate * phi / SIZES**2 * (reference - model) / n),
        ]
    )


def test_converges_to_an_ode_solver_on_the_law_as_the_period_falls():
    end, errors = 0.2, []
    oracle = solve_ivp(flow, (0.0, end), np.zeros(4), args=(20.0, 200.0), rtol=1e-9, atol=1e-9)
    for dt in (4e-4, 1e-4):
        t = dt * np.arange(1, round(end / dt) + 1)
        v, x = regressors(t)
        estimator = ReferenceModel(20.0, tuple(SIZES), 200.0, FLOOR)
        estimator.run(x, v, PLANT[0] * v + PLANT[1] * x, dt)
        errors.append(abs(estimator.estimate.k - oracle.y[3, -1]))
    assert errors[1] < 0.01 * oracle.y[3, -1]
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.2)


@given(
    rate=st.floats(1e-2, 1e6),
    a=st.floats(1e-2, 1e6),
    seed=st.integers(0, 1000),
    decades=st.floats(-6.0, 6.0),
)
def test_the_lyapunov_function_never_grows(rate, a, seed, decades):
    rng = np.random.default_rng(seed)
    estimator = ReferenceModel(rate, tuple(SIZES), a)
    value = math.inf
    for _ in range(30):
        x, v = 10.0**decades * SIZES[::-1] * rng.normal(size=2)
        f = PLANT[0] * v + PLANT[1] * x
        b, k, *_ = estimator.update(x, v, f, 10.0 ** rng.uniform(-5.0, 5.0))
        off = SIZES * (np.array([b, k]) - PLANT)
        after = estimator.state.e**2 + a / rate * (off @ off)
        assert after <= value * (1.0 + 1e-9) + 1e-12 * a / rate
        value = after


@pytest.mark.parametrize("k", [2000.0, 5000.0, 30000.0])
@pytest.mark.parametrize("depth", [2e-3, 5e-3, 10e-3])
def test_one_rate_is_suitable_for_all_cubes_and_depths(depth, k):
    t = 1e-3 * np.arange(700)
    x = depth * (1.0 + 0.6 * np.sin(19.0 * t))
    v = depth * 0.6 * 19.0 * np.cos(19.0 * t)
    estimates = ReferenceModel(25.0, tuple(SIZES)).run(x, v, 20.0 * v + k * x, 1e-3)
    assert estimates.k[-1] == pytest.approx(k, rel=0.05)


def test_with_noise_stays_within_two_percent_and_names_no_deviation(palpation):
    estimates = ReferenceModel(25.0, tuple(SIZES)).run(*palpation(seconds=10.0, noise=0.02))
    assert np.abs(estimates.k[5000:] / 2100.0 - 1.0).max() < 0.02
    assert np.isnan(estimates.k_std).all()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, (1.0, 1.0)), "rate"),
        ((1.0, (1.0, math.nan)), "sizes"),
        ((1.0, (1.0, 1.0), -1.0), "bandwidth"),
        ((1.0, (1.0, 1.0), 1.0, 0.0), "floor"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        ReferenceModel(*arguments)
