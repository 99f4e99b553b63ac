from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation import AdaptiveIdentification, paper_preset
from estimation.methods.adaptive_identification import RK4_LIMIT

SOFT = (2000.0, 1.2e5)


def flow(theta, phi, f, gain):
    """Adaptive law (8) of the paper."""
    return -np.asarray(gain) * phi * (phi @ theta - f)


@pytest.mark.parametrize("method", ["rk4", "exact"])
def test_equals_an_ode_solver_on_the_adaptive_law(palpation, method):
    s = palpation(seconds=0.5, noise=0.05, jitter=0.3)
    estimates = AdaptiveIdentification(SOFT, method).run(*s)
    theta = np.zeros(2)
    expected = []
    for x, v, f, dt in zip(*s, strict=True):
        phi = np.array([v, x])
        solution = solve_ivp(
            lambda _, y, phi=phi, f=f: flow(y, phi, f, SOFT),
            (0.0, dt),
            theta,
            rtol=1e-10,
            atol=1e-10,
        )
        theta = solution.y[:, -1]
        expected.append(theta)
    np.testing.assert_allclose(np.column_stack(estimates[:2]), expected, rtol=1e-7, atol=1e-7)


@given(
    x=st.floats(-0.02, 0.02), v=st.floats(-0.2, 0.2), f=st.floats(-50, 50), dt=st.floats(1e-4, 1e-3)
)
def test_rk4_is_the_four_stages_of_runge_kutta(x, v, f, dt):
    phi = np.array([v, x])
    theta = np.zeros(2)
    k1 = flow(theta, phi, f, SOFT)
    k2 = flow(theta + 0.5 * dt * k1, phi, f, SOFT)
    k3 = flow(theta + 0.5 * dt * k2, phi, f, SOFT)
    k4 = flow(theta + dt * k3, phi, f, SOFT)
    expected = theta + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    got = AdaptiveIdentification(SOFT, "rk4").update(x, v, f, dt)[:2]
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-12)


def test_the_limit_is_where_rk4_stops_contracting():
    def growth(z):
        return abs(1.0 - z + z**2 / 2.0 - z**3 / 6.0 + z**4 / 24.0)

    assert growth(RK4_LIMIT - 1e-9) < 1.0 < growth(RK4_LIMIT + 1e-9)


def test_the_papers_hard_cube_exceeds_the_limit_at_17_mm_and_the_exact_solution_is_used():
    gain = paper_preset("hard").adaptation_gain
    estimator = AdaptiveIdentification(gain, "rk4")
    estimator.update(0.0166, 0.0, 300.0, 1e-3)
    assert estimator.beyond_rk4 == 0
    estimator.update(0.017, 0.0, 300.0, 1e-3)
    assert estimator.beyond_rk4 == 1
    assert "in 1 samples" in estimator.note(estimator.run([], [], [], []))


@given(
    gain=st.floats(1e-3, 1e12),
    dt=st.floats(1e-5, 1.0),
    method=st.sampled_from(["rk4", "exact"]),
)
def test_never_diverges_for_any_gain_and_period(gain, dt, method):
    estimator = AdaptiveIdentification((gain, gain), method)
    error = math.inf
    for n in range(50):
        x, v = 5e-3 * math.sin(n), 0.05 * math.cos(n)
        b, k, *_ = estimator.update(x, v, 20.0 * v + 2000.0 * x, dt)
        after = math.hypot(b - 20.0, k - 2000.0)
        assert after <= error * (1.0 + 1e-9)
        error = after


def test_with_persistent_excitation_converges_to_the_plant(palpation):
    estimates = AdaptiveIdentification(SOFT, "exact").run(*palpation(seconds=15.0))
    assert estimates.b[-1] == pytest.approx(20.0, rel=0.01)
    assert estimates.k[-1] == pytest.approx(2100.0, rel=0.001)


@pytest.mark.parametrize("gain", [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (1.0,)])
def test_a_gain_that_is_not_positive_is_refused(gain):
    with pytest.raises(ValueError, match="gain"):
        AdaptiveIdentification(gain)


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match="'rk4' or 'exact'"):
        AdaptiveIdentification(SOFT, "euler")
