from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.compiled import numbers
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.methods.subspace_forgetting import SubspaceForgetting
from estimation.model import WITH_DATUM

P0 = (1.6e7, 4e8)


def test_equals_the_algorithm_of_the_paper(palpation):
    s = palpation(noise=0.05)
    p0 = (*P0, 1e4)
    scale = np.sqrt(p0)
    estimator = SubspaceForgetting(0.98, p0, model=WITH_DATUM, threshold=150.0)
    estimates = estimator.run(*s, np.ones((len(s.x), 1)))
    information, theta = np.eye(3), np.zeros(3)
    for n, (x, v, f) in enumerate(zip(s.x, s.v, s.f, strict=True)):
        z = scale * (v, x, 1.0)
        small = math.hypot(*z) < 150.0
        assert estimates.held[n] == small
        if not small:
            rz = information @ z
            information = information - 0.02 * np.outer(rz, rz) / (z @ rz) + np.outer(z, z)
            theta = theta + np.linalg.solve(information, z) * (f - z @ theta)
        got = estimates.b[n], estimates.k[n], estimates.further["f0"].value[n]
        np.testing.assert_allclose(got, scale * theta, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(estimator.scaled_covariance @ information, np.eye(3), atol=1e-6)
    assert 0.05 < np.mean(estimates.held) < 0.95


def test_without_forgetting_is_least_squares(palpation):
    s = palpation(noise=0.05)
    expected = RecursiveLeastSquares(1.0, P0).run(*s)
    np.testing.assert_allclose(SubspaceForgetting(1.0, P0).run(*s)[:4], expected[:4], rtol=1e-6)


def test_a_sample_below_the_threshold_is_held(palpation):
    estimator = SubspaceForgetting(0.98, P0)
    estimator.run(*palpation(noise=0.05))
    before, covariance = estimator.estimate, estimator.scaled_covariance
    small = np.full(100, 0.9 / math.sqrt(P0[1]))
    assert estimator.run(small, 0.0 * small, small, 1e-3).held.all()
    assert estimator.estimate[:4] == before[:4]
    assert np.array_equal(estimator.scaled_covariance, covariance)
    assert not estimator.update(2.0 * float(small[0]), 0.0, 1.0, 1e-3).held


def test_follows_the_stiffness_while_the_damping_rests(palpation):
    estimator = SubspaceForgetting(0.98, P0, 1e-3)
    estimator.run(*palpation())
    x = np.full(2000, 5e-3)
    estimates = estimator.run(x, 0.0 * x, 4000.0 * x, 1e-3)
    assert estimates.k[-1] == pytest.approx(4000.0, rel=1e-6)
    assert np.diag(estimator.scaled_covariance).max() < 1.0


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.floats(-6.0, 6.0),
    threshold=st.floats(0.05, 10.0),
)
def test_covariance_stays_positive_and_below_the_papers_bound(seed, size, threshold):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 200)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    estimator = SubspaceForgetting(0.9, P0, threshold=threshold)
    estimator.run(x * rng.integers(0, 2, 200), v, f, 10.0 ** rng.uniform(-5.0, 5.0, 200))
    assert np.isfinite(numbers(estimator.state)).all()
    assert min(estimator.state.D) > 0.0
    bound = max(1.0, 0.1 / threshold**2)
    assert np.linalg.eigvalsh(estimator.scaled_covariance).max() <= bound * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((1.1, P0), "forgetting"),
        ((0.98, (1.0,)), "covariance"),
        ((0.98, P0, 0.0), "period"),
        ((0.98, P0, None, 0.0), "threshold"),
        ((0.98, P0, None, math.nan), "threshold"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        SubspaceForgetting(*arguments)
