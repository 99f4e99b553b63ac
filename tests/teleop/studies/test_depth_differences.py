"""A study reports the factors whose levels differ in the depth of the palpation."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from teleop.evaluation.across.comparison import Compared
from teleop.studies.anova import depth_note

FACTORS = ["condition", "cube"]


def study(depth_of):
    """Return three recordings for each combination of levels."""
    return [
        Compared(
            "a.mcap",
            {"condition": condition, "cube": cube},
            SimpleNamespace(depth=depth_of(condition, cube, number)),
            {},
        )
        for condition, cube, number in product(["free", "mimic"], ["soft", "hard"], range(3))
    ]


@given(st.floats(1e-4, 0.05))
def test_equal_depths_that_vary_by_a_few_percent_are_not_reported(depth):
    rows = study(lambda condition, cube, number: depth * (1.0 + 0.02 * number))
    assert depth_note(rows, FACTORS) == ""


@given(st.floats(1e-4, 0.05), st.floats(1.2, 20.0))
def test_the_factor_whose_levels_have_other_depths_is_named(depth, ratio):
    rows = study(lambda condition, cube, number: depth * (ratio if condition == "free" else 1.0))
    note = depth_note(rows, FACTORS)
    assert "levels of condition (by up to" in note
    assert "cube" not in note


def test_recordings_without_a_result_are_not_used():
    rows = study(lambda condition, cube, number: None if condition == "free" else 0.01)
    assert depth_note(rows, FACTORS) == ""
