"""Fits that share a baseline, against fits of all regressors at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.baseline import cosines
from estimation.baseline_fit import BaselineFits
from estimation.robust_error import robust_fit


@given(
    n=st.integers(40, 200),
    order=st.integers(0, 12),
    further=st.integers(1, 6),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_fit_beyond_a_baseline_equals_the_fit_of_all_regressors(n, order, further, seed):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, n)
    basis, columns = cosines(t, 0.0, 1.0, order), rng.normal(size=(n, further))
    f = rng.normal(size=n).cumsum()
    whole = robust_fit(np.column_stack([basis, columns]), f)
    fit = BaselineFits(basis, f).fit(columns)
    for ours, theirs in zip(fit[:2], whole[:2], strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())
    np.testing.assert_allclose(fit.leverage, whole.leverage, rtol=1e-9, atol=1e-12)
    gradients = rng.normal(size=(2, order + 1 + further))
    np.testing.assert_allclose(gradients @ fit.inverse, gradients @ whole.inverse, atol=1e-9)
    expected = whole.deviation(gradients[0])
    assert fit.deviation(gradients[0]) == pytest.approx(expected, rel=1e-8)


def test_a_regressor_within_the_baseline_has_the_parameter_zero():
    t = np.linspace(0.0, 1.0, 100)
    basis = cosines(t, 0.0, 1.0, 3)
    fit = BaselineFits(basis, np.sin(5.0 * t)).fit(np.column_stack([basis[:, 1] + 2.0, t]))
    assert fit.theta[4] == 0.0
    assert fit.theta[5] != 0.0
