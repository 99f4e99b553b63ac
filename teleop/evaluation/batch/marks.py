"""Decide whether k and b of a result can be used."""

from __future__ import annotations

from typing import NamedTuple

from estimation.quantities import DAMPING
from estimation.trust import LARGEST_SHIFT, NOT_YET, UNUSABLE, USABLE, WIDEST, percent
from teleop.evaluation.batch.stiffness_result import StiffnessResult


class Mark(NamedTuple):
    """Whether k or b can be used, and why, in the words of the live page."""

    mark: str
    reason: str


def marks_of(result: StiffnessResult, lag_known: bool) -> dict[str, Mark]:
    """Return the marks of k and b. `lag_known` is whether the lag of the force is known."""
    return {part: mark_of(result, part, lag_known) for part in WIDEST}


def mark_of(result: StiffnessResult, part: str, lag_known: bool) -> Mark:
    """Return the mark of k or b (`part`)."""
    value = getattr(result, part)
    if value is None:
        return Mark(UNUSABLE, "not determined")
    low, high = result.interval(part)
    if part == "b" and low <= 0.0 <= high:
        return Mark(UNUSABLE, "the interval contains zero")
    shift = result.b_change_per_ms
    if part == "b" and shift and not lag_known and shift > LARGEST_SHIFT * abs(value):
        return Mark(UNUSABLE, f"force lag not known: {DAMPING.text(-shift, '.3g')} per ms")
    width = 0.5 * (high - low) / abs(value)
    return Mark(USABLE if width <= WIDEST[part] else NOT_YET, percent(width))
