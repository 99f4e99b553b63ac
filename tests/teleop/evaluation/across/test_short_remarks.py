"""Remarks of several recordings are counted together, without their numbers."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.evaluation.across.groups import remark_counts, short
from teleop.evaluation.batch.stiffness_result import StiffnessResult


@pytest.mark.parametrize(
    ("remark", "expected"),
    [
        (
            "Kelvin-Voigt is insufficient: the stiffness depends on depth (degree 3) and force "
            "relaxes (0.2 s, 1.1 s); residual 0.12 N, and 0.03 N if the model contains this",
            "Kelvin-Voigt is insufficient: the stiffness depends on depth and force relaxes",
        ),
        ("adhesion: the force falls by 0.2 N below its level out of contact", "adhesion"),
        (
            "a baseline is removed (0.1 N peak to peak, below 0.2 Hz): drift, relaxation, or a "
            "transient at the start",
            "a baseline is removed: drift, relaxation, or a transient at the start",
        ),
        (
            "the stiffness changes over the cycles, from 900 to 800 N/m (medians of the first and "
            "of the last cycles)",
            "the stiffness changes over the cycles",
        ),
        (
            "the speed in contact is constant: damping is not determined",
            "the speed in contact is constant: damping is not determined",
        ),
        (
            "damping is not resolved: its interval contains zero",
            "damping is not resolved: its interval contains zero",
        ),
    ],
)
def test_a_short_remark_has_no_numbers(remark, expected):
    assert short(remark) == expected


@given(st.lists(st.integers(0, 999), min_size=1, max_size=5))
def test_remarks_that_differ_in_their_numbers_are_counted_together(sizes):
    results = [
        StiffnessResult(reasons=(f"adhesion: the force falls by {size} N",)) for size in sizes
    ]
    assert remark_counts(results) == {"adhesion": len(sizes)}


def test_a_result_is_counted_once_for_each_remark():
    one = StiffnessResult(reasons=("bad fit: 12%", "bad fit: 13%", "negative"))
    assert remark_counts([one, replace(one, reasons=("negative",))]) == {
        "bad fit": 1,
        "negative": 2,
    }
    assert not re.search(r"\d", "".join(remark_counts([one])))
