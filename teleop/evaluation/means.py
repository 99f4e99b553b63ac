"""Compute means over recordings, with 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from teleop.evaluation.tracking import EARLIEST, Tracking

TURN = 360.0
"""Full turn of a phase [deg]."""


class Value(NamedTuple):
    """Value of a quantity for one recording."""

    value: float
    """The value; finite."""
    half: float
    """Half width of its 95 % interval; NaN if there is no interval."""
    kind: str
    """Kind of the quantity (`teleop.evaluation.kinds`)."""


class Mean(NamedTuple):
    """Mean of a quantity over a group of recordings, with its 95 % interval."""

    value: float
    """Mean; NaN if there are no values, or if the values are of different kinds."""
    half: float
    """Half width of the interval of the mean; NaN if there is no interval."""
    recordings: int
    """Number of recordings in the mean."""


def mean_of(values: Sequence[Value]) -> Mean:
    """Return the mean of a quantity over recordings, with its 95 % interval.

    Values of different kinds have no mean. The half width of the interval is the root of the sum of
    the squares of two parts:

    - A half width from the spread between the recordings and Student's t. It needs two or more
      recordings. It does not contain an error that is equal in all recordings, for example because
      the model is wrong.
    - The mean of the half widths of the intervals of the single recordings, if all of them have
      intervals. The error of the mean is this large if all recordings have the same error.

    Because of the second part, the interval of the mean contains zero if the intervals of all
    recordings contain zero.
    """
    if len({one.kind for one in values}) != 1:
        return Mean(math.nan, math.nan, 0)
    numbers = np.array([one.value for one in values])
    parts = [float(np.mean([one.half for one in values]))]
    if numbers.size > 1:
        spread = float(np.std(numbers, ddof=1)) / math.sqrt(numbers.size)
        parts.append(float(stdtrit(numbers.size - 1, 0.975)) * spread)
    known = [part for part in parts if math.isfinite(part)]
    half = math.hypot(*known) if known else math.nan
    return Mean(float(np.mean(numbers)), half, numbers.size)


def mean_tracking(tracked: Sequence[Tracking]) -> dict[str, Mean]:
    """Return the means of gain, phase_deg, rms_m and frequency_hz; empty without recordings.

    The mean of the phase is a circular mean: the direction of the sum of unit vectors with these
    phases. The half width of an interval that contains impossible values is replaced by NaN:

    - for the phase, if the half width is 180 degrees or more;
    - for the other quantities, which are positive, if the lower end of the interval is negative.
    """
    if not tracked:
        return {}
    found = {}
    for name in ("gain", "rms_m", "frequency_hz"):
        mean = mean_of([Value(getattr(one, name), math.nan, "") for one in tracked])
        found[name] = mean if mean.half <= mean.value else mean._replace(half=math.nan)
    phases = np.array([one.phase_deg for one in tracked])
    centre = math.degrees(np.angle(np.mean(np.exp(1j * np.radians(phases)))))
    near = centre + (phases - centre + TURN / 2.0) % TURN - TURN / 2.0
    mean = mean_of([Value(float(phase), math.nan, "") for phase in near])
    value = (centre / TURN - EARLIEST) % -1.0 + EARLIEST
    half = mean.half if mean.half < TURN / 2.0 else math.nan
    return {**found, "phase_deg": Mean(TURN * value, half, len(tracked))}
