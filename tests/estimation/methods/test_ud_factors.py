from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.compiled import numbers
from estimation.linear_gain import linear_gain_state
from estimation.methods.ud_factors import (
    FactoredParameters,
    FactoredState,
    add,
    add_variance,
    predicted_variance,
    trace,
    update_covariance,
    variance,
)

CASES = given(m=st.integers(2, 5), seed=st.integers(0, 2**32 - 1), size=st.floats(-6.0, 6.0))


def factored(m, seed):
    rng = np.random.default_rng(seed)
    u = np.eye(m) + np.triu(rng.normal(size=(m, m)), 1)
    d = 10.0 ** rng.uniform(-3.0, 3.0, m)
    return u, d, rng.normal(size=m)


def state_of(u, d, y):
    fields = linear_gain_state([1.0] * len(d))
    return FactoredState(
        **fields, U=u.T.tolist(), D=d.tolist(), y=y.tolist(), bound=0.0, dt=0.0, beta=1.0
    )


def unscaled(m):
    return FactoredParameters(1.0, (1.0,) * m, 1.0, 0.0)


def covariance_in(state):
    u, d = np.array(state.U).T, np.array(state.D)
    m = len(d)
    assert (d > 0.0).all()
    assert np.array_equal(u, np.triu(u, 1) + np.eye(m))
    return u * d @ u.T


def exactly(values):
    return np.vectorize(Fraction, otypes=[object])(values)


def assert_close(got, expected):
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


@settings(max_examples=40, deadline=None)
@CASES
def test_the_covariance_update_equals_the_direct_formula(m, seed, size):
    u, d, z = factored(m, seed)
    z *= 10.0**size
    p, noise = u * d @ u.T, 0.7
    state = state_of(u, d, z)
    scaled = unscaled(m), state, z.tolist()
    assert predicted_variance(*scaled) == pytest.approx(z @ p @ z, rel=1e-9)
    assert update_covariance(*scaled, noise) == pytest.approx(noise + z @ p @ z, rel=1e-9)
    assert_close(state.L, p @ z)
    u, d, z = exactly(u), exactly(d), exactly(z)
    p = u * d @ u.T
    expected = p - np.outer(p @ z, p @ z) / (Fraction(noise) + z @ p @ z)
    assert_close(covariance_in(state), expected.astype(float))


@settings(max_examples=40, deadline=None)
@CASES
def test_a_rank_one_update_equals_the_direct_formula(m, seed, size):
    u, d, y = factored(m, seed)
    state = state_of(u, d, y)
    add(state, 10.0**size, m)
    assert_close(covariance_in(state), u * d @ u.T + 10.0**size * np.outer(y, y))


@settings(max_examples=25, deadline=None)
@CASES
def test_a_variance_is_added_to_one_parameter_alone(m, seed, size):
    u, d, y = factored(m, seed)
    i, expected = seed % m, u * d @ u.T
    state = state_of(u, d, y)
    assert variance(state, i) == pytest.approx(expected[i, i], rel=1e-12)
    assert trace(state) == pytest.approx(np.trace(expected), rel=1e-12)
    add_variance(state, i, 10.0**size)
    expected[i, i] += 10.0**size
    assert_close(covariance_in(state), expected)


@given(seed=st.integers(0, 2**32 - 1))
def test_stays_positive_definite_for_all_updates(seed):
    rng = np.random.default_rng(seed)
    u, d, _ = factored(3, seed)
    state = state_of(u, d, np.zeros(3))
    for _ in range(60):
        z = rng.choice([-1.0, 0.0, 1.0], 3) * 10.0 ** rng.uniform(-30.0, 30.0, 3)
        state.D = [10.0 * value for value in state.D]
        update_covariance(unscaled(3), state, z.tolist(), 1.0)
        state.y = rng.normal(size=3).tolist()
        add(state, 1e-9, 3)
        covariance_in(state)
        assert np.isfinite(numbers(state)).all()
