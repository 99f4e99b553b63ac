"""Percentiles of values in blocks are those of numpy, with bounded memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.recording import timing
from teleop.recording.timing import DIGITS, Percentiles, rounded

BLOCKS = st.lists(
    st.lists(st.floats(-1e6, 1e6) | st.sampled_from([0.0, 1e-6, 2e-6]), max_size=20),
    min_size=1,
    max_size=6,
).filter(any)
SHARES = (0.0, 12.5, 50.0, 99.0, 99.9, 100.0)


@given(BLOCKS, st.sampled_from([1, 7, 1 << 16]))
def test_percentiles_in_blocks_are_those_of_numpy_to_the_bit(blocks, merged):
    found = Percentiles()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "MERGED", merged)
        for block in blocks:
            found.add(np.array(block))
    values = np.concatenate([np.array(block) for block in blocks])
    for share in SHARES:
        assert found.value(share) == np.percentile(values, share)


@given(BLOCKS)
def test_of_too_many_different_values_percentiles_are_those_of_rounded_values(blocks):
    found = Percentiles()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "MERGED", 1)
        patch.setattr(timing, "MOST", 5)
        for block in blocks:
            found.add(np.array(block))
    values = np.concatenate([np.array(block) for block in blocks])
    assert len(np.unique(values)) <= 5 or len(found._values) <= len(np.unique(rounded(values)))
    for share in SHARES:
        near = (
            np.percentile(values, share, method="lower"),
            np.percentile(values, share, method="higher"),
        )
        error = 2.0**-DIGITS * np.max(np.abs(near))
        assert found.value(share) == pytest.approx(np.percentile(values, share), abs=2.0 * error)


def test_the_memory_does_not_depend_on_the_number_of_values():
    found, draw = Percentiles(), np.random.default_rng(1)
    for _ in range(40):
        found.add(1e-5 * draw.lognormal(0.0, 2.0, 1 << 15))
    assert found.value(50.0) == pytest.approx(1e-5, rel=0.01)
    assert len(found._values) < 1 << 17


def test_without_values_or_with_nan_a_percentile_is_nan():
    found = Percentiles()
    assert math.isnan(found.value(50.0))
    found.add(np.array([1.0, math.nan, 2.0]))
    assert math.isnan(found.value(50.0))
