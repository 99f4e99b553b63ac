"""Compute means over recordings, with 95 % intervals from the spread between the recordings."""

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

    For two or more recordings, the interval is computed with Student's t from the spread between
    the recordings. For one recording, it is the interval of this recording. Values of different
    kinds have no mean.
    """
    if len({one.kind for one in values}) != 1:
        return Mean(math.nan, math.nan, 0)
    if len(values) == 1:
        return Mean(values[0].value, values[0].half, 1)
    numbers = [one.value for one in values]
    spread = float(np.std(numbers, ddof=1)) / math.sqrt(len(numbers))
    half = float(stdtrit(len(numbers) - 1, 0.975)) * spread
    return Mean(float(np.mean(numbers)), half, len(numbers))


def mean_tracking(tracked: Sequence[Tracking]) -> dict[str, Mean]:
    """Return the means of gain, phase_deg, rms_m and frequency_hz; empty without recordings.

    The mean of the phase is the direction of the mean of the unit vectors with these phases. An
    interval that exceeds the possible values states nothing, and is NaN: that of the phase if its
    half width is half a turn or more, and that of the other values, which are positive, if its
    lower end is negative.
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
