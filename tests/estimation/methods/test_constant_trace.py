from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.compiled import numbers
from estimation.methods.constant_trace import ConstantTrace
from estimation.model import WITH_DATUM

P0 = (1.6e7, 4e8)


def test_equals_the_formula_of_astrom_and_wittenmark(palpation):
    s = palpation(noise=0.05)
    p0 = (*P0, 1e4)
    scale = np.sqrt(p0)
    estimator = ConstantTrace(1e-5, p0, 1e3, WITH_DATUM)
    estimates = estimator.run(*s, np.ones((len(s.x), 1)))
    p, theta, expected = np.eye(3), np.zeros(3), []
    for x, v, f in zip(s.x, s.v, s.f, strict=True):
        z = scale * (v, x, 1.0)
        gain = p @ z / (1.0 + z @ p @ z)
        theta = theta + gain * (f - z @ theta)
        p = p - np.outer(gain, z @ p)
        p = 1e-5 * p / np.trace(p) + 1e-8 * np.eye(3)
        expected.append(scale * theta)
    got = np.column_stack((estimates.b, estimates.k, estimates.further["f0"].value))
    np.testing.assert_allclose(got, expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(estimator.scaled_covariance, p, rtol=1e-7, atol=1e-15)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.floats(-6.0, 6.0),
    trace=st.floats(1e-6, 1e3),
    ratio=st.floats(1.0, 1e8),
)
def test_trace_is_constant_for_all_signals(seed, size, trace, ratio):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 200)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    estimator = ConstantTrace(trace, P0, ratio)
    estimator.run(x * rng.integers(0, 2, 200), v, f, 10.0 ** rng.uniform(-5.0, 5.0, 200))
    assert np.isfinite(numbers(estimator.state)).all()
    p, rest = estimator.scaled_covariance, trace / ratio
    assert np.trace(p) == pytest.approx(trace + 2.0 * rest, rel=1e-9)
    assert np.linalg.eigvalsh(p).min() >= rest - 1e-12 * trace


def test_no_motion_leaves_the_estimate_and_the_trace(palpation):
    estimator = ConstantTrace(1e-5, P0)
    estimator.run(*palpation(noise=0.05))
    before = estimator.estimate
    zeros = np.zeros(5000)
    estimator.run(zeros, zeros, zeros, 1e-3)
    assert estimator.estimate[:2] == before[:2]
    assert np.trace(estimator.scaled_covariance) == pytest.approx(1e-5 * 1.0002)


def test_forgetting_depends_on_the_size_of_the_motion():
    t = np.arange(4000) * 1e-3
    x, v = 5e-3 * np.cos(200.0 * t), -25e-3 * np.sin(200.0 * t)
    k = np.where(t < 2.0, 2000.0, 3000.0)
    q = 0.5e4
    estimates = ConstantTrace(2.0 * 0.02 / q, P0).run(x, v, k * x, 1e-3)
    left = (3000.0 - estimates.k[2050]) / 1000.0
    assert left == pytest.approx(0.98**50, rel=0.2)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ((0.0, P0), "trace"),
        ((math.inf, P0), "trace"),
        ((1.0, (1.0, -1.0)), "covariance"),
        ((1.0, P0, 0.5), "ratio"),
        ((1.0, P0, 1e9), "ratio"),
    ],
)
def test_a_parameter_out_of_range_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        ConstantTrace(*arguments)
