"""Detect gaps, in which samples are missing, and filter the pieces between gaps separately."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.arrays import Floats
from teleop.evaluation.reading.thresholds import LONG_PERIOD


def long_periods(dt: Floats) -> NDArray[np.intp]:
    """Return the index of the first sample after each gap.

    A gap is a sample period that is longer than `LONG_PERIOD` times the median period.
    """
    return np.flatnonzero(dt > LONG_PERIOD * np.median(dt))


def closed_up(dt: Floats, gaps: Sequence[int]) -> Floats:
    """Return the sample periods [s], shape (n,), with the duration of gaps removed.

    At the first sample after each gap, the period is replaced by the median period.
    """
    periods = dt.copy()
    periods[list(gaps)] = np.median(dt)
    return periods


class PiecewiseConditioner:
    """Filters a record in blocks of samples, and restarts the filters after each gap.

    In a gap, samples are missing. The filters compute displacement, velocity and force from the
    measured position and force (conditioning).
    """

    def __init__(self, conditioner: Conditioner) -> None:
        self._conditioner = conditioner
        self._resumed = -np.inf
        conditioner.reset()

    def run(
        self, t: Floats, x: Floats, f: Floats, dt: Floats, gaps: Sequence[int]
    ) -> tuple[Regression, NDArray[np.bool_]]:
        """Filter the next block of n samples."""
        conditioner = self._conditioner
        bounds = sorted({0, len(t), *gaps})
        settled = np.ones(len(t), dtype=np.bool_)
        parts = []
        for start, end in pairwise(bounds):
            if start in gaps:
                conditioner.reset()
                self._resumed = float(t[start])
            parts.append(conditioner.run(x[start:end], f[start:end], dt[start:end]))
            settled[start:end] = t[start:end] - self._resumed > conditioner.settling
        channels = (np.concatenate(channel) for channel in zip(*parts, strict=True))
        return Regression(*channels), settled
