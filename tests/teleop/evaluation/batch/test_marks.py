"""Marks of k and b of a result."""

from __future__ import annotations

import pytest

from estimation.trust import NOT_YET, UNUSABLE, USABLE
from teleop.evaluation.batch.marks import marks_of
from teleop.evaluation.batch.stiffness_result import StiffnessResult


def result(k_half=10.0, b=5.0, b_half=0.5):
    return StiffnessResult(
        1000.0, 1000.0 - k_half, 1000.0 + k_half, b, b - b_half, b + b_half, True
    )


@pytest.mark.parametrize(
    ("found", "lag_known", "k", "b"),
    [
        (result(), True, (USABLE, "± 1.0 %"), (USABLE, "± 10 %")),
        (result(k_half=0.1), True, (USABLE, "± <0.1 %"), (USABLE, "± 10 %")),
        (result(k_half=200.0), True, (NOT_YET, "± 20 %"), (USABLE, "± 10 %")),
        (result(b_half=4.0), True, (USABLE, "± 1.0 %"), (NOT_YET, "± 80 %")),
        (result(b_half=6.0), True, (USABLE, "± 1.0 %"), (UNUSABLE, "the interval contains zero")),
        (result(), False, (USABLE, "± 1.0 %"), (USABLE, "± 10 %")),
        (
            result(b=1.5),
            False,
            (USABLE, "± 1.0 %"),
            (UNUSABLE, "force lag not known: -1 N s/m per ms"),
        ),
        (StiffnessResult(), True, (UNUSABLE, "not determined"), (UNUSABLE, "not determined")),
    ],
)
def test_the_mark_depends_on_interval_and_force_lag(found, lag_known, k, b):
    assert marks_of(found, lag_known) == {"k": k, "b": b}
