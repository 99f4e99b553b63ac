"""Compute the frequency, amplitude and travel of the motion in a record."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.baseline import FEWEST_CYCLES, without_baseline
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.turning_points import cycle_frequency, least_stroke, turning_points

FEWEST_STROKES = round(2 * FEWEST_CYCLES) - 1
"""Smallest number of whole strokes for which a frequency is computed."""
NOISE = 6.0
"""Least median stroke of a motion, in standard deviations of the noise of the position."""


class Motion(NamedTuple):
    """Description of the motion in a record."""

    frequency_hz: float
    """Mean frequency of the cycles [Hz]; NaN for a motion without cycles."""
    amplitude_m: float
    """Half of the median travel between two reversals [m]; NaN for a motion without cycles."""
    travel_m: float
    """Largest minus smallest position [m]."""
    strokes: int
    """Number of whole strokes, from one reversal to the next; 0 if they are not larger than the
    noise."""
    fundamental_share: float
    """Share of the fundamental in the motion, 1 for a sine; NaN for a motion of less than three
    cycles. See `teleop.evaluation.prepared.Prepared.fundamental_share`."""


def motion_of(record: Prepared) -> Motion:
    """Return the motion in a record, computed from the smoothed position."""
    x = record.sharpened(record.x)
    travel = float(np.ptp(x))
    palpation = without_baseline(x, record.order)
    turns = turning_points(palpation, least_stroke(palpation))[1:-1]
    strokes = np.abs(np.diff(palpation[turns]))
    frequency = cycle_frequency(record.palpation, record.period)
    found = len(strokes)
    if not found or float(np.median(strokes)) < NOISE * record.x_noise:
        found = 0
    if frequency is None or found < FEWEST_STROKES:
        return Motion(math.nan, math.nan, travel, found, record.fundamental_share)
    half = 0.5 * float(np.median(strokes))
    return Motion(frequency, half, travel, found, record.fundamental_share)
