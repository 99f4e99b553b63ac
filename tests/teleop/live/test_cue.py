"""The cue that the operator follows in the terminal."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.live.progress import BOTH, OWN, TARGET, WIDTH, Cue

CUE = Cue(depth=10e-3, count_in=3.0)


def cell(text, mark):
    return text.index(mark) - 1


def test_deeper_is_further_to_the_right():
    text = CUE.text(5.0, 9e-3, 1e-3)
    assert 0 < cell(text, OWN) < cell(text, TARGET) < WIDTH - 1


def test_one_mark_is_shown_where_both_are_at_the_same_place():
    text = CUE.text(5.0, 5e-3, 5e-3)
    assert BOTH in text
    assert TARGET not in text
    assert OWN not in text


@given(target=st.floats(-1.0, 1.0), position=st.floats(-1.0, 1.0))
def test_the_bar_keeps_its_width_wherever_the_marks_are(target, position):
    assert len(CUE.text(5.0, target, position)) == WIDTH + 2


@pytest.mark.parametrize(
    ("t", "end"), [(-0.1, "| in 3"), (0.5, "| in 3"), (1.0, "| in 2"), (2.9, "| in 1"), (3.0, "|")]
)
def test_the_seconds_before_the_target_moves_are_counted_down(t, end):
    assert CUE.text(t, 1e-3, 0.0).endswith(end)


def test_without_a_target_only_the_own_position_is_shown():
    text = CUE.text(-0.1, math.nan, 0.0)
    assert OWN in text
    assert TARGET not in text
