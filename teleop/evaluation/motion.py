"""Compute the frequency, amplitude and travel of the motion in a record."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.baseline import FEWEST_CYCLES, without_baseline
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.turning_points import turning_points


class Motion(NamedTuple):
    """Description of the motion in a record."""

    frequency_hz: float
    """Mean frequency of the cycles [Hz]; NaN for a motion without cycles."""
    amplitude_m: float
    """Half of the median travel between two reversals [m]; NaN for a motion without cycles."""
    travel_m: float
    """Largest minus smallest position [m]."""


def motion_of(record: Prepared) -> Motion:
    """Return the motion in a record, computed from the smoothed position."""
    x = record.sharpened(record.x)
    travel = float(np.ptp(x))
    palpation = without_baseline(x, record.order)
    turns = turning_points(palpation, float(np.std(palpation)))[1:-1]
    strokes = np.abs(np.diff(palpation[turns]))
    if len(strokes) < 2 * FEWEST_CYCLES - 1:
        return Motion(math.nan, math.nan, travel)
    frequency = record.frequency
    if not math.isfinite(frequency):  # without contact
        frequency = 0.5 * len(strokes) / float(record.clock[turns[-1]] - record.clock[turns[0]])
    return Motion(frequency, 0.5 * float(np.median(strokes)), travel)
