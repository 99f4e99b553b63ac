from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.methods.lattice import least_in_box

numbers = st.integers(-200, 200)


@settings(max_examples=100)
@given(
    rows=st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=5),
    i_last=st.integers(1, 30),
    j_last=st.integers(1, 40),
    ridge=st.sampled_from([1e-6, 1e-3, 1.0]),
    stretch=st.sampled_from([1e-3, 1.0, 30.0]),
)
def test_finds_the_same_minimum_as_an_exhaustive_search(rows, i_last, j_last, ridge, stretch):
    p, q, r = np.array(rows, dtype=float).T
    p = p * stretch
    a, b, c = float(p @ p) + ridge, float(p @ q), float(q @ q) + ridge
    g, h = float(p @ r), float(q @ r)
    i, j = np.meshgrid(np.arange(i_last + 1), np.arange(j_last + 1), indexing="ij")
    form = a * i * i + 2 * b * i * j + c * j * j + 2 * g * i + 2 * h * j
    found = least_in_box(a, b, c, g, h, i_last, j_last)
    scale = a * i_last**2 + c * j_last**2 + abs(g) * i_last + abs(h) * j_last
    assert form[found] <= form.min() + 1e-12 * scale
