"""Repeatability and agreement, against the published examples of the methods."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.errors import InputError
from teleop.evaluation.across.agreement import agreement, repeatability, value_table

JUDGES = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
)
"""Ratings of 6 targets by 4 judges (Shrout and Fleiss, 1979, table 2)."""
LARGE = [494, 395, 516, 434, 476, 557, 413, 442, 650, 433, 417, 656, 267, 478, 178, 423, 427]
LARGE_AGAIN = [490, 397, 512, 401, 470, 611, 415, 431, 638, 429, 420, 633, 275, 492, 165, 372, 421]
MINI = [512, 430, 520, 428, 500, 600, 364, 380, 658, 445, 432, 626, 260, 477, 259, 350, 451]
"""Peak expiratory flow rate of 17 persons, by two meters (Bland and Altman, 1986, table 1)."""


def test_the_intraclass_correlations_are_those_of_shrout_and_fleiss():
    found = repeatability(JUDGES, "1234")
    expected = {  # the intervals are those that the R package psych prints for these data
        "ICC(1,1)": (0.17, -0.133, 0.723),
        "ICC(2,1)": (0.29, 0.019, 0.761),
        "ICC(3,1)": (0.71, 0.342, 0.946),
    }
    for name, (value, low, high) in expected.items():
        assert found.icc[name].value == pytest.approx(value, abs=0.006)
        assert found.icc[name][1:] == pytest.approx((low, high), abs=6e-4)


def test_the_limits_of_agreement_are_those_of_bland_and_altman():
    found = agreement(MINI, LARGE, ["mini", "large"])
    assert found.bias == pytest.approx((-2.1, -22.0, 17.8), abs=0.06)
    deviation = (found.upper.value - found.bias.value) / 1.96
    assert deviation == pytest.approx(38.8, abs=0.06)
    limits = [found.bias.value + side * 2.0 * deviation for side in (-1.0, 1.0)]
    # they use 2 instead of 1.96, and computed the limits from the rounded bias and deviation
    assert limits == pytest.approx([-79.7, 75.5], abs=0.1)
    assert not found.increases


def test_the_repeatability_coefficient_is_that_of_bland_and_altman():
    found = repeatability(np.column_stack([LARGE, LARGE_AGAIN]), ["1", "2"])
    # they use 2 instead of 1.96, and the standard deviation of the differences is 21.6 l/min
    assert found.coefficient.value / 1.96 == pytest.approx(21.6, abs=0.1)
    assert found.within.value == pytest.approx(15.3, abs=0.05)


def test_the_intervals_of_the_limits_and_of_the_deviation_contain_the_truth_in_95_percent():
    rng = np.random.default_rng(20461301)
    hits = np.zeros(2)
    for differences in rng.normal(3.0, 2.0, (1500, 6)):
        upper = agreement(np.zeros(6), differences, "ab").upper
        pairs = np.column_stack([np.arange(6.0), np.arange(6.0) + differences - 3.0])
        within = repeatability(pairs, "ab").within
        hits += [
            upper.low < 3.0 + 1.959964 * 2.0 < upper.high,
            within.low < 2.0 / 2**0.5 < within.high,
        ]
    assert hits / 1500 == pytest.approx([0.95, 0.95], abs=0.02)


def test_differences_that_increase_with_the_value_are_noticed():
    values = np.linspace(100.0, 1000.0, 20)
    signs = np.where(np.arange(20) % 2, 1.0, -1.0)
    assert agreement(values, values * (1.0 + 0.1 * signs), "ab").increases
    assert not agreement(values, values + 10.0 * signs, "ab").increases


def test_only_objects_with_a_value_in_each_column_are_used():
    values = {("a",): {"1": 1.0, "2": 2.0}, ("b",): {"2": 3.0}, ("c",): {"2": 5.0, "1": 4.0}}
    complete, table, others = value_table(values, ["1", "2"])
    assert (complete, others) == ([("a",), ("c",)], [("b",)])
    assert table.tolist() == [[1.0, 2.0], [4.0, 5.0]]


def test_identical_repetitions_have_an_icc_of_one():
    found = repeatability(np.column_stack([[1.0, 2.0, 4.0]] * 2), "ab")
    assert found.icc["ICC(1,1)"] == found.icc["ICC(3,1)"] == (1.0, 1.0, 1.0)
    assert found.within == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        (np.ones((2, 2)), "expected at least 3 objects with 2 values each, got 2 with 2"),
        (np.ones((5, 1)), "got 5 with 1"),
        (np.ones((5, 2)), "all values are the same"),
    ],
)
def test_too_few_or_equal_values_are_refused(values, problem):
    with pytest.raises(InputError, match=problem):
        repeatability(values, "ab")
