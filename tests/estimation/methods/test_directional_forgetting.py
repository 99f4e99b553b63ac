from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.compiled import numbers
from estimation.methods.directional_forgetting import DirectionalForgetting
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.methods.ud_factors import WINDUP

P0 = (1.6e7, 4e8)


def test_equals_the_formula_of_kulhavy_and_karny(palpation):
    s = palpation(noise=0.05)
    estimator = DirectionalForgetting(0.98, P0)
    estimates = estimator.run(*s)
    p, theta, expected = np.diag(P0), np.zeros(2), []
    for x, v, f in zip(s.x, s.v, s.f, strict=True):
        phi = np.array([v, x])
        r = phi @ p @ phi
        theta = theta + p @ phi / (1.0 + r) * (f - phi @ theta)
        p = p - np.outer(p @ phi, p @ phi) / (1.0 / (0.98 - 0.02 / r) + r)
        expected.append(theta)
    np.testing.assert_allclose(np.column_stack(estimates[:2]), expected, rtol=1e-7, atol=1e-7)
    scaled = p / np.sqrt(np.outer(P0, P0))
    np.testing.assert_allclose(estimator.scaled_covariance, scaled, rtol=1e-6)


def test_without_forgetting_is_least_squares(palpation):
    s = palpation(noise=0.05)
    expected = RecursiveLeastSquares(1.0, P0).run(*s)
    np.testing.assert_allclose(DirectionalForgetting(1.0, P0).run(*s)[:4], expected[:4], rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(angle=st.floats(0.0, 6.28), size=st.floats(-3.0, 3.0), dt=st.floats(1e-5, 0.1))
def test_information_orthogonal_to_the_sample_is_kept(angle, size, dt):
    estimator = DirectionalForgetting(0.9, (1.0, 1.0), 1e-3)
    estimator.run([1.0, -0.5], [0.3, 0.8], [1.0, 1.0], 1e-3)
    before = np.linalg.inv(estimator.scaled_covariance)
    x, v = 10.0**size * np.cos(angle), 10.0**size * np.sin(angle)
    estimator.run([x], [v], [1.0], dt)
    across = np.array([np.cos(angle), -np.sin(angle)])
    after = np.linalg.inv(estimator.scaled_covariance)
    np.testing.assert_allclose(after @ across, before @ across, rtol=1e-6, atol=1e-6)


def test_without_motion_the_estimate_does_not_change(palpation):
    estimator = DirectionalForgetting(0.98, P0)
    estimator.run(*palpation(noise=0.05))
    before, covariance = estimator.estimate, estimator.scaled_covariance
    zeros = np.zeros(3000)
    estimator.run(zeros, zeros, zeros, 1e-3)
    assert estimator.estimate[:2] == before[:2]
    assert np.array_equal(estimator.scaled_covariance, covariance)


def test_follows_the_stiffness_while_the_damping_rests(palpation):
    estimator = DirectionalForgetting(0.98, P0, 1e-3)
    estimator.run(*palpation())
    x = np.full(2000, 5e-3)
    estimates = estimator.run(x, 0.0 * x, 4000.0 * x, 1e-3)
    assert estimates.k[-1] == pytest.approx(4000.0, rel=1e-6)
    assert np.diag(estimator.scaled_covariance).max() < 1.0


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.floats(-300.0, 6.0))
def test_covariance_stays_positive_and_bounded_for_all_signals(seed, size):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 200)) * 10.0 ** rng.uniform(min(size, -6.0), size, (3, 1))
    estimator = DirectionalForgetting(0.5, P0, 1e-3)
    estimator.run(x * rng.integers(0, 2, 200), v, f, 10.0 ** rng.uniform(-5.0, 5.0, 200))
    assert np.isfinite(numbers(estimator.state)).all()
    assert min(estimator.state.D) > 0.0
    assert (np.diag(estimator.scaled_covariance) <= WINDUP * (1.0 + 1e-9)).all()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [((1.1, P0), "forgetting"), ((0.98, (1.0,)), "covariance"), ((0.98, P0, 0.0), "period")],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        DirectionalForgetting(*arguments)
