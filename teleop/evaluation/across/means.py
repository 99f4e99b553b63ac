"""Compute the mean of a result over several recordings, with its 95 % interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from teleop.evaluation.teleoperation.thresholds import LARGEST_LEAD
from teleop.evaluation.teleoperation.tracking import Tracking

TURN = 360.0
"""Full turn of a phase [deg]."""


class Value(NamedTuple):
    """Value of a quantity, for example of the stiffness, from one recording."""

    value: float
    """The value; finite."""
    half: float
    """Half width of the 95 % interval of the value; NaN if there is no interval."""
    kind: str
    """Kind of the quantity, for example "tangent" for a tangent stiffness
    (`teleop.evaluation.batch.kinds`). Only values of the same kind are averaged."""


class Mean(NamedTuple):
    """Mean of a quantity over a group of recordings, with its 95 % interval."""

    value: float
    """Mean; NaN if there are no values, or if the values are of different kinds."""
    half: float
    """Half width of the 95 % interval of the mean; NaN if there is no interval."""
    recordings: int
    """Number of recordings whose values are averaged; 0 if `value` is NaN."""


def mean_of(values: Sequence[Value], units: Sequence[str] = ()) -> Mean:
    """Return the mean of a quantity over recordings, with its 95 % interval.

    `units` names, for each value, what is independent of the other units, for example the subject.
    The values of each unit are averaged first, and the mean and its interval are those of the
    averages. Without `units`, each recording is independent.

    The mean is NaN if there are no values, or if the values are of different kinds, for example
    tangent and average stiffness (`Value.kind`). The half width of the interval is
    sqrt(s^2 + m^2), with two parts s and m:

    - s is computed from the standard deviation between the recordings, or between the averages of
      the units, and Student's t. It is used if there are two or more of these. It does not include
      an error that is equal in all recordings, for example because the model is wrong.
    - m is the mean of the half widths of the intervals of the recordings. It is used if every
      recording has an interval. It includes errors that are equal in all recordings.

    If the intervals of all recordings contain zero, the interval of the mean contains zero too,
    because of m. If neither part can be used, the half width is NaN.
    """
    if len({one.kind for one in values}) != 1:
        return Mean(math.nan, math.nan, 0)
    members: dict[str, list[float]] = {}
    names = units or [str(number) for number in range(len(values))]
    for unit, one in zip(names, values, strict=True):
        members.setdefault(unit, []).append(one.value)
    numbers = np.array([np.mean(each) for each in members.values()])
    parts = [float(np.mean([one.half for one in values]))]
    if numbers.size > 1:
        spread = float(np.std(numbers, ddof=1)) / math.sqrt(numbers.size)
        parts.append(float(stdtrit(numbers.size - 1, 0.975)) * spread)
    known = [part for part in parts if math.isfinite(part)]
    half = math.hypot(*known) if known else math.nan
    return Mean(float(np.mean(numbers)), half, len(values))


def mean_tracking(tracked: Sequence[Tracking], units: Sequence[str] = ()) -> dict[str, Mean]:
    """Return the means of the tracking values over recordings, with 95 % intervals.

    The tracking values describe how well the motion follows a sinusoidal target (`Tracking`). The
    keys of the result are `gain`, `phase_deg`, `rms_m` and `frequency_hz`. The result is empty if
    `tracked` is empty. `units` are those of `mean_of`.

    The mean of the phase is a circular mean: the direction of the sum of unit vectors that have the
    phases as directions. If an interval contains impossible values, its half width is replaced by
    NaN:

    - for the phase, if the half width is 180 degrees or more;
    - for the other quantities, which are positive, if the lower end of the interval is negative.
    """
    if not tracked:
        return {}
    found = {}
    for name in ("gain", "rms_m", "frequency_hz"):
        mean = mean_of([Value(getattr(one, name), math.nan, "") for one in tracked], units)
        found[name] = mean if mean.half <= mean.value else mean._replace(half=math.nan)
    phases = np.array([one.phase_deg for one in tracked])
    centre = math.degrees(np.angle(np.mean(np.exp(1j * np.radians(phases)))))
    near = centre + (phases - centre + TURN / 2.0) % TURN - TURN / 2.0
    mean = mean_of([Value(float(phase), math.nan, "") for phase in near], units)
    value = (centre / TURN - LARGEST_LEAD) % -1.0 + LARGEST_LEAD
    half = mean.half if mean.half < TURN / 2.0 else math.nan
    return {**found, "phase_deg": Mean(TURN * value, half, len(tracked))}
