from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.methods.indirect_adaptive import IndirectAdaptive
from estimation.model import WITH_DATUM

SIZES = np.array([0.025, 5e-3])
FLOOR = 0.02


def flow(theta, phi, f, rate):
    """Return the derivative of theta by the normalised gradient law."""
    s = phi / SIZES
    return rate / (FLOOR + s @ s) * phi / SIZES**2 * (f - phi @ theta)


def test_equals_an_ode_solver_on_the_law(palpation):
    s = palpation(seconds=0.3, noise=0.05, jitter=0.3)
    estimates = IndirectAdaptive(27.0, tuple(SIZES), FLOOR).run(*s)
    theta = np.zeros(2)
    expected = []
    for x, v, f, dt in zip(*s, strict=True):
        phi = np.array([v, x])
        solution = solve_ivp(
            lambda _, y, phi=phi, f=f: flow(y, phi, f, 27.0),
            (0.0, dt),
            theta,
            rtol=1e-10,
            atol=1e-10,
        )
        theta = solution.y[:, -1]
        expected.append(theta)
    got = np.column_stack((estimates.b, estimates.k))
    np.testing.assert_allclose(got, expected, rtol=1e-7, atol=1e-7)


@given(
    rate=st.floats(1e-3, 1e9),
    seed=st.integers(0, 1000),
    decades=st.floats(-6.0, 6.0),
)
def test_the_error_never_grows_for_any_rate_depth_and_period(rate, seed, decades):
    rng = np.random.default_rng(seed)
    estimator = IndirectAdaptive(rate, tuple(SIZES), FLOOR)
    error = math.inf
    for _ in range(30):
        x, v = 10.0**decades * SIZES[::-1] * rng.normal(size=2)
        estimate = estimator.update(x, v, 20.0 * v + 2000.0 * x, 10.0 ** rng.uniform(-5.0, 5.0))
        after = math.hypot(0.025 * (estimate.b - 20.0), 5e-3 * (estimate.k - 2000.0))
        assert after <= error * (1.0 + 1e-9) + 1e-9
        error = after


@pytest.mark.parametrize("k", [2000.0, 5000.0, 30000.0])
@pytest.mark.parametrize("depth", [2e-3, 5e-3, 10e-3])
def test_one_rate_is_suitable_for_all_cubes_and_depths(depth, k):
    t = 1e-3 * np.arange(700)
    x = depth * (1.0 + 0.6 * np.sin(19.0 * t))
    v = depth * 0.6 * 19.0 * np.cos(19.0 * t)
    estimates = IndirectAdaptive(27.0, tuple(SIZES)).run(x, v, 20.0 * v + k * x, 1e-3)
    assert estimates.k[-1] == pytest.approx(k, rel=0.05)


def test_the_interval_has_its_nominal_coverage_of_the_plant(palpation):
    inside = []
    for seed in range(30):
        estimator = IndirectAdaptive(10.0, tuple(SIZES))
        estimator.run(*palpation(seconds=3.0, noise=0.5, seed=seed))
        b, k, b_std, k_std, *_ = estimator.estimate
        inside += [abs(b - 20.0) < 1.96 * b_std, abs(k - 2100.0) < 1.96 * k_std]
    assert 0.85 < np.mean(inside) <= 1.0
    assert k_std < 40.0


@pytest.mark.usefixtures("interpreted")
def test_with_a_datum_finds_where_the_surface_is(palpation):
    s = palpation(seconds=10.0)
    x = s.x - 5e-3
    estimator = IndirectAdaptive(10.0, (*SIZES, 1.0), model=WITH_DATUM)
    where = 1e-3
    f = 20.0 * s.v + 2100.0 * (x - where)
    estimator.run(x, s.v, f, s.dt, np.ones((len(x), 1)))
    k, f0 = estimator.values["k"][0], estimator.values["f0"][0]
    assert -f0 / k == pytest.approx(where, rel=0.02)


def test_out_of_contact_the_estimate_is_held():
    estimator = IndirectAdaptive(27.0, tuple(SIZES))
    for _ in range(1000):
        estimate = estimator.update(0.0, 0.0, 5.0, 1e-3)
    assert (estimate.b, estimate.k) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, (1.0, 1.0)), "rate"),
        ((math.inf, (1.0, 1.0)), "rate"),
        ((1.0, (1.0, -1.0)), "sizes"),
        ((1.0, (1.0, 1.0), 0.0), "floor"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        IndirectAdaptive(*arguments)
