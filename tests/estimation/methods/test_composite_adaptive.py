from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.methods.composite_adaptive import CompositeAdaptive
from estimation.model import WITH_DATUM

SIZES = np.array([0.025, 5e-3])
PLANT = np.array([20.0, 2100.0])
FORGETTING, BANDWIDTH, INSTANT, BOUND = 30.0, 100.0, 0.7, 50.0


def regressors(t):
    return np.array([57e-3 * np.cos(19.0 * t), 5e-3 + 3e-3 * np.sin(19.0 * t)])


def flow(t, y):
    """Slotine and Li's law with filtered regressors, in the units of the samples."""
    theta, w, fw, information = y[:2], y[2:4], y[4], y[5:].reshape(2, 2)
    phi = regressors(t)
    f = phi @ PLANT
    least = np.diag(SIZES**2) / (BOUND * FORGETTING)
    p = np.linalg.inv(information)
    return np.concatenate(
        (
            p @ (w * (fw - w @ theta) + INSTANT * phi * (f - phi @ theta)),
            BANDWIDTH * (phi - w),
            [BANDWIDTH * (f - fw)],
            (-FORGETTING * (information - least) + np.outer(w, w)).ravel(),
        )
    )


def test_converges_to_an_ode_solver_on_the_law_as_the_period_falls():
    end, errors = 0.1, []
    start = [0.0] * 5 + (np.diag(SIZES**2) / (BOUND * FORGETTING)).ravel().tolist()
    oracle = solve_ivp(flow, (0.0, end), start, method="LSODA", rtol=1e-9, atol=1e-14)
    for dt in (4e-4, 1e-4):
        t = dt * np.arange(1, round(end / dt) + 1)
        v, x = regressors(t)
        estimator = CompositeAdaptive(FORGETTING, tuple(SIZES), BANDWIDTH, INSTANT, BOUND)
        estimator.run(x, v, PLANT[0] * v + PLANT[1] * x, dt)
        b, k, *_ = estimator.estimate
        errors.append(np.abs(SIZES * (np.array([b, k]) - oracle.y[:2, -1])).max())
    assert errors[1] < 0.01 * (SIZES * PLANT).max()
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.2)


def test_one_period_is_the_implicit_matrix_formula_for_any_number_of_regressors():
    rng = np.random.default_rng(1)
    sizes = np.array([0.025, 5e-3, 1.0])
    estimator = CompositeAdaptive(
        FORGETTING, tuple(sizes), BANDWIDTH, INSTANT, BOUND, model=WITH_DATUM
    )
    least = np.eye(3) / (BOUND * FORGETTING)
    theta, w, fw, information = np.zeros(3), np.zeros(3), 0.0, least
    dt = 2e-3
    for _ in range(50):
        phi, f = rng.normal(size=3) * sizes, 10.0 * rng.normal()
        s = phi / sizes
        share, kept = 1.0 - math.exp(-BANDWIDTH * dt), math.exp(-FORGETTING * dt)
        w = w + share * (s - w)
        fw += share * (f - fw)
        information = kept * information + (1.0 - kept) * least + dt * np.outer(w, w)
        theta = theta + np.linalg.solve(
            information + INSTANT * dt * np.outer(s, s),
            dt * (w * (fw - w @ theta) + INSTANT * s * (f - s @ theta)),
        )
        estimator.update(phi[1], phi[0], f, dt, phi[2:])
        got = [value for value, _ in estimator.values.values()]
        np.testing.assert_allclose(got, theta / sizes, rtol=1e-9)


@given(
    forgetting=st.floats(1e-1, 1e4),
    instant=st.floats(0.0, 100.0),
    seed=st.integers(0, 1000),
    decades=st.floats(-4.0, 4.0),
)
def test_the_lyapunov_function_never_grows(forgetting, instant, seed, decades):
    rng = np.random.default_rng(seed)
    estimator = CompositeAdaptive(forgetting, tuple(SIZES), instant=instant)
    value = math.inf
    for _ in range(30):
        x, v = 10.0**decades * SIZES[::-1] * rng.normal(size=2)
        f = PLANT[0] * v + PLANT[1] * x
        b, k, *_ = estimator.update(x, v, f, 10.0 ** rng.uniform(-5.0, 5.0))
        lower = np.array(estimator.state.R)
        information = np.tril(lower) + np.tril(lower, -1).T
        off = SIZES * (np.array([b, k]) - PLANT)
        after = off @ information @ off
        assert after <= value * (1.0 + 1e-6) + 1e-12
        value = after


@pytest.mark.parametrize("hz", [2.0, 3.0])
@pytest.mark.parametrize("depth", [2e-3, 10e-3])
def test_a_jump_of_stiffness_is_followed_within_300_ms(depth, hz):
    t = 1e-3 * np.arange(3000)
    w = 2.0 * math.pi * hz
    x = depth * (1.0 + 0.6 * np.sin(w * t))
    v = depth * 0.6 * w * np.cos(w * t)
    k = np.where((t >= 1.0) & (t < 2.0), 20000.0, 2000.0)
    estimates = CompositeAdaptive(40.0, tuple(SIZES)).run(x, v, 20.0 * v + k * x, 1e-3)
    off = np.abs(estimates.k / k - 1.0)
    assert off[1300:2000].max() < 0.05
    assert off[2300:].max() < 0.05


def test_stiffness_is_followed_at_rest_too(palpation):
    estimator = CompositeAdaptive(40.0, tuple(SIZES))
    estimator.run(*palpation())
    rest = np.full(1000, 5e-3)
    estimator.run(rest, 0.0 * rest, 2100.0 * rest, 1e-3)
    estimator.run(rest, 0.0 * rest, 4200.0 * rest, 1e-3)
    assert estimator.estimate.k == pytest.approx(4200.0, rel=0.01)
    assert estimator.estimate.b == pytest.approx(20.0, rel=0.01)


def test_with_noise_stays_within_two_percent_and_names_no_deviation(palpation):
    estimates = CompositeAdaptive(40.0, tuple(SIZES)).run(*palpation(seconds=10.0, noise=0.02))
    assert np.abs(estimates.k[5000:] / 2100.0 - 1.0).max() < 0.02
    assert np.isnan(estimates.k_std).all()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, (1.0, 1.0)), "forgetting"),
        ((1.0, (1.0, 0.0)), "sizes"),
        ((1.0, (1.0, 1.0), math.nan), "bandwidth"),
        ((1.0, (1.0, 1.0), 1.0, -1.0), "instant"),
        ((1.0, (1.0, 1.0), 1.0, 1.0, 0.5), "bound"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        CompositeAdaptive(*arguments)
