import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from estimation.methods.passive_least_squares import PassiveLeastSquares
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.model import STIFFENING, WITH_DATUM

BETA, P0 = 0.97, (1e8, 1e10)


def constrained(phi, f, p0):
    """Return the non-negative minimum by scipy, with the initial guess as additional rows."""
    weights = np.sqrt(BETA) ** np.arange(len(f) - 1, -1, -1)
    first = np.diag(np.sqrt(BETA ** len(f) / np.array(p0)))
    rows = np.vstack((phi * weights[:, None], first))
    size = np.sqrt(np.sum(rows**2, axis=0))
    theta, _ = nnls(rows / size, np.append(f * weights, np.zeros(len(p0))))
    return theta / size


@settings(max_examples=20, deadline=None)
@given(st.floats(-400.0, 400.0), st.floats(-3000.0, 3000.0), st.integers(0, 99))
def test_is_the_constrained_minimum(b, k, seed):
    rng = np.random.default_rng(seed)
    n = 40
    x = 5e-3 + np.cumsum(rng.normal(0.0, 3e-4, n))
    v = rng.normal(0.0, 0.025, n) + rng.uniform(-20.0, 20.0) * x
    f = b * v + k * x + rng.normal(0.0, 0.1, n)
    estimator = PassiveLeastSquares(BETA, P0)
    estimator.run(x, v, f, 1e-3)
    b_least, k_least = constrained(np.column_stack((v, x)), f, P0)
    assert estimator.estimate.b == pytest.approx(b_least, rel=1e-5, abs=1e-5)
    assert estimator.estimate.k == pytest.approx(k_least, rel=1e-5, abs=1e-3)


def test_three_parameters_are_nearly_always_at_the_constrained_minimum():
    rng = np.random.default_rng(0)
    p0 = (1e8, 1e10, 1e20)
    exact = 0
    for _ in range(100):
        x = 5e-3 + 3e-3 * rng.uniform(-1.0, 1.0, 40)
        phi = np.column_stack((rng.normal(0.0, 0.025, 40), x, x**3))
        f = phi @ (rng.normal(0, 30), rng.normal(0, 2e3), rng.normal(0, 2e7))
        estimator = PassiveLeastSquares(BETA, p0, model=STIFFENING)
        estimator.run(x, phi[:, 0], f, 1e-3, phi[:, 2:])
        theta = [value for value, _ in estimator.values.values()]
        assert min(theta) >= 0.0
        expected = constrained(phi, f, p0)
        exact += np.allclose(phi @ theta, phi @ expected, rtol=1e-3, atol=1e-3)
    assert exact >= 98


def test_is_recursive_least_squares_where_that_is_passive(palpation):
    signals = palpation(noise=0.02)
    passive = PassiveLeastSquares(0.98, P0, 1e-3).run(*signals)
    plain = RecursiveLeastSquares(0.98, P0, 1e-3).run(*signals)
    inside = (plain.b > 0.0) & (plain.k > 0.0)
    assert inside.mean() > 0.95
    np.testing.assert_allclose(passive.b[inside], plain.b[inside], rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(passive.k[inside], plain.k[inside], rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(passive.k_std[100:], plain.k_std[100:], rtol=1e-4)


def test_the_bound_has_no_effect_after_damping_is_positive(palpation):
    x, v, _, dt = palpation(seconds=3.0)
    b = np.where(np.cumsum(dt) < 1.5, -50.0, 20.0)
    estimates = PassiveLeastSquares(0.98, P0, 1e-3).run(x, v, b * v + 2100.0 * x, dt)
    assert np.all(estimates.b[100:1400] == 0.0)
    assert estimates.b[-1] == pytest.approx(20.0, rel=1e-6)


def test_a_datum_may_be_negative(palpation):
    x, v, f, dt = palpation()
    ones = np.ones((len(x), 1))
    estimator = PassiveLeastSquares(0.98, (*P0, 1e4), 1e-3, WITH_DATUM)
    estimates = estimator.run(x, v, f - 3.0, dt, ones)
    assert estimates.further["f0"].value[-1] == pytest.approx(-3.0, abs=1e-3)


def test_reset_forgets_the_unconstrained_minimum_too(palpation):
    signals = palpation(seconds=0.2, noise=0.02)
    estimator = PassiveLeastSquares(0.98, P0)
    first = estimator.run(*signals)
    estimator.reset()
    np.testing.assert_array_equal(estimator.run(*signals).k, first.k)


def test_refuses_a_forgetting_factor_of_zero():
    with pytest.raises(ValueError, match="forgetting factor"):
        PassiveLeastSquares(0.0, P0)
