"""Baselines of evenly spaced samples."""

from __future__ import annotations

import tracemalloc

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from estimation.baseline import cosines, without_baseline


@given(n=st.integers(20, 400), share=st.floats(0.0, 0.9), seed=st.integers(0, 2**32 - 1))
def test_the_baseline_is_the_least_squares_fit_of_its_cosines(n, share, seed):
    order = int(share * (n - 2))
    values = np.random.default_rng(seed).normal(size=n).cumsum()
    t = np.arange(n) * 1e-3
    basis = cosines(t, 0.0, t[-1], order)
    fitted = basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    expected = values if order == 0 else values - fitted
    size = np.abs(values).max()
    np.testing.assert_allclose(without_baseline(values, order), expected, rtol=0, atol=1e-11 * size)


def test_the_memory_for_a_baseline_does_not_depend_on_the_number_of_cosines():
    values = np.random.default_rng(0).normal(size=100_000)
    without_baseline(values, 300)
    tracemalloc.start()
    without_baseline(values, 300)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10 * values.nbytes
