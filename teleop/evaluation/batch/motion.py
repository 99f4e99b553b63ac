"""Compute the frequency, amplitude and travel of the palpating motion in a record."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.baseline import FEWEST_CYCLES, without_baseline
from teleop.evaluation.batch.prepared import Prepared
from teleop.evaluation.batch.turning_points import cycle_frequency, least_stroke, turning_points

FEWEST_STROKES = round(2 * FEWEST_CYCLES) - 1
"""Smallest number of whole strokes for which a frequency is computed. A stroke is the motion from
one reversal to the next."""
NOISE = 6.0
"""Smallest median travel of the strokes that counts as a motion, in standard deviations of the
noise of the position."""


class Motion(NamedTuple):
    """Frequency, amplitude, travel and shape of the motion in a record.

    The values describe the position. A stroke is the motion from one reversal to the next.
    """

    frequency_hz: float
    """Mean frequency of the cycles [Hz]; NaN if there are fewer than `FEWEST_STROKES` strokes."""
    amplitude_m: float
    """Half of the median travel of the strokes [m]; NaN if `frequency_hz` is NaN."""
    travel_m: float
    """Largest minus smallest position [m]."""
    strokes: int
    """Number of whole strokes; 0 if their median travel is not clearly larger than the noise."""
    fundamental_share: float
    """Share of the fundamental frequency in the power of the velocity: 1 for a sine, NaN for a
    motion with too few cycles (`teleop.evaluation.batch.prepared.Prepared.fundamental_share`)."""


def motion_of(record: Prepared) -> Motion:
    """Return frequency, amplitude, travel and shape of the motion in a record.

    They are computed from the smoothed position. Smoothing makes the amplitude smaller. This effect
    is nearly compensated (`Prepared.sharpened`).
    """
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
