from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.compiled import numbers
from estimation.methods.conditional_update import ConditionalUpdate
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.methods.ud_factors import WINDUP

P0 = (1.6e7, 4e8)


def test_conditional_update_equals_least_squares_of_the_informative_samples(palpation):
    s = palpation(noise=0.05)
    estimates = ConditionalUpdate(0.98, P0, threshold=1.5).run(*s)
    p, theta = np.diag(P0), np.zeros(2)
    for n, (x, v, f) in enumerate(zip(s.x, s.v, s.f, strict=True)):
        phi = np.array([v, x])
        news = phi @ p @ phi
        assert estimates.held[n] == (news <= 1.5 * 0.02)
        if not estimates.held[n]:
            gain = p @ phi / (0.98 + news)
            theta = theta + gain * (f - phi @ theta)
            p = (p - np.outer(gain, phi @ p)) / 0.98
        np.testing.assert_allclose((estimates.b[n], estimates.k[n]), theta, rtol=1e-6, atol=1e-6)
    assert 0.1 < np.mean(estimates.held) < 0.9


def test_conditional_update_with_threshold_zero_is_least_squares(palpation):
    s = palpation(noise=0.05)
    conditional, plain = (
        ConditionalUpdate(0.98, P0, threshold=0.0),
        RecursiveLeastSquares(0.98, P0),
    )
    assert np.array_equal(conditional.run(*s)[:4], plain.run(*s)[:4])


def test_conditional_update_holds_uninformative_samples(palpation):
    estimator = ConditionalUpdate(0.98, P0)
    estimator.run(*palpation())
    before = deepcopy(estimator.state)
    zeros = np.zeros(100)
    assert estimator.run(zeros, zeros, zeros + 5.0, 1e-3).held.all()
    assert replace(estimator.state, bound=before.bound, held=before.held) == before


def test_conditional_update_does_not_wind_up_while_a_probe_rests(palpation):
    rng = np.random.default_rng(1)
    s = palpation(noise=0.02)
    plain, conditional = RecursiveLeastSquares(0.98, P0), ConditionalUpdate(0.98, P0)
    x, v = 5e-3 + 1e-6 * rng.normal(size=5000), 1e-3 * rng.normal(size=5000)
    f = 20.0 * v + 2100.0 * x + 0.02 * rng.normal(size=5000)
    grown = {}
    for estimator in (plain, conditional):
        estimator.run(*s)
        before = estimator.scaled_covariance[0, 0]
        estimator.run(x, v, f, 1e-3)
        grown[estimator] = estimator.scaled_covariance[0, 0] / before
    assert grown[plain] > 50.0
    assert grown[conditional] < 2.0


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, P0), "forgetting"),
        ((0.98, (0.0, 1.0)), "covariance"),
        ((0.98, P0, -1e-3), "period"),
        ((0.98, P0, None, -1.0), "threshold"),
        ((0.98, P0, None, math.inf), "threshold"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        ConditionalUpdate(*arguments)


@pytest.mark.parametrize("method", [RecursiveLeastSquares, ConditionalUpdate])
def test_a_processed_sample_ends_a_hold(method):
    estimator = method(0.98, P0)
    assert estimator.hold().held
    assert not estimator.update(5e-3, 0.02, 10.0, 1e-3).held


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.floats(-6.0, 6.0),
    method=st.sampled_from([RecursiveLeastSquares, ConditionalUpdate]),
)
def test_covariance_stays_positive_and_bounded_for_all_signals(seed, size, method):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 200)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    estimator = method(0.98, P0, 1e-3)
    estimator.run(x * rng.integers(0, 2, 200), v, f, 10.0 ** rng.uniform(-5.0, 5.0, 200))
    assert np.isfinite(numbers(estimator.state)).all()
    assert min(estimator.state.D) > 0.0
    assert (np.diag(estimator.scaled_covariance) <= WINDUP * (1.0 + 1e-9)).all()
