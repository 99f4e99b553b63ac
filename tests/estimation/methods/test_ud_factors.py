from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.linear_gain import gain_at, own
from estimation.methods.ud_factors import add, project, take_in

CASES = given(m=st.integers(2, 5), seed=st.integers(0, 2**32 - 1), size=st.floats(-6.0, 6.0))


def factored(m, seed):
    rng = np.random.default_rng(seed)
    u = np.eye(m) + np.triu(rng.normal(size=(m, m)), 1)
    d = 10.0 ** rng.uniform(-3.0, 3.0, m)
    return u, d, rng.normal(size=m)


def state_of(u, d, y):
    return [0.0] * own(len(d)) + [*map(float, (*u.flat, *d, *y))]


def covariance_in(state, m):
    u = np.reshape(state[own(m) : own(m) + m * m], (m, m))
    d = np.array(state[own(m) + m * m : own(m) + m * m + m])
    assert (d > 0.0).all()
    assert np.array_equal(u, np.triu(u, 1) + np.eye(m))
    return u * d @ u.T


def exactly(values):
    return np.vectorize(Fraction, otypes=[object])(values)


def assert_close(got, expected):
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


@settings(max_examples=100, deadline=None)
@CASES
def test_a_measurement_is_taken_in_as_by_the_plain_formula(m, seed, size):
    u, d, z = factored(m, seed)
    z *= 10.0**size
    p, noise = u * d @ u.T, 0.7
    state = state_of(u, d, z)
    assert project(state, z) == pytest.approx(z @ p @ z, rel=1e-9)
    assert take_in(state, z, noise) == pytest.approx(noise + z @ p @ z, rel=1e-9)
    assert_close(state[gain_at(m) : gain_at(m) + m], p @ z)
    u, d, z = exactly(u), exactly(d), exactly(z)
    p = u * d @ u.T
    expected = p - np.outer(p @ z, p @ z) / (Fraction(noise) + z @ p @ z)
    assert_close(covariance_in(state, m), expected.astype(float))


@settings(max_examples=100, deadline=None)
@CASES
def test_a_vector_is_added_as_by_the_plain_formula(m, seed, size):
    u, d, y = factored(m, seed)
    state = state_of(u, d, y)
    add(state, y, 10.0**size)
    assert_close(covariance_in(state, m), u * d @ u.T + 10.0**size * np.outer(y, y))


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_stays_positive_whatever_is_taken_in_and_added(seed):
    rng = np.random.default_rng(seed)
    u, d, _ = factored(3, seed)
    state = state_of(u, d, np.zeros(3))
    at = own(3) + 12
    for _ in range(60):
        z = rng.choice([-1.0, 0.0, 1.0], 3) * 10.0 ** rng.uniform(-30.0, 30.0, 3)
        state[at : at + 3] = z.tolist()
        project(state, z)
        state[at - 3 : at] = [10.0 * value for value in state[at - 3 : at]]
        take_in(state, z, 1.0)
        state[at : at + 3] = rng.normal(size=3).tolist()
        add(state, z, 1e-9)
        covariance_in(state, 3)
        assert all(map(math.isfinite, state))
