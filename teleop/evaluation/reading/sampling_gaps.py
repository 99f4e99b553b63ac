"""Detect gaps, in which samples are missing, and filter the pieces between gaps separately."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.arrays import Floats

LONG = 20.0
"""A sample period is a gap if it is longer than this multiple of the median period."""


def long_periods(dt: Floats) -> NDArray[np.intp]:
    """Return the index of the first sample after each gap.

    A gap is a sample period that is longer than `LONG` times the median period.

    Parameters
    ----------
    dt
        Time since the previous sample [s], shape (n,).
    """
    return np.flatnonzero(dt > LONG * np.median(dt))


def closed_up(dt: Floats, gaps: Sequence[int]) -> Floats:
    """Return the sample periods [s], shape (n,), with the duration of gaps removed.

    At the first sample after each gap, the period is replaced by the median period.

    Parameters
    ----------
    dt
        Time since the previous sample [s], shape (n,).
    gaps
        Index of the first sample after each gap.
    """
    periods = dt.copy()
    periods[list(gaps)] = np.median(dt)
    return periods


class PiecewiseConditioner:
    """Filters a record in blocks of samples, and restarts the filters after each gap.

    In a gap, samples are missing. The filters compute displacement, velocity and force from the
    measured position and force (conditioning).

    Parameters
    ----------
    conditioner
        The filters. They are also reset when this object is created.
    """

    def __init__(self, conditioner: Conditioner) -> None:
        self._conditioner = conditioner
        self._resumed = -np.inf
        conditioner.reset()

    def run(
        self, t: Floats, x: Floats, f: Floats, dt: Floats, gaps: Sequence[int]
    ) -> tuple[Regression, NDArray[np.bool_]]:
        """Filter the next block of n samples.

        Parameters
        ----------
        t, x, f, dt
            Time [s], position [m], force [N] and time since the previous sample [s], each of shape
            (n,).
        gaps
            Index of the first sample after each gap.

        Returns
        -------
        The n filtered samples, and a mask of shape (n,). The mask is False at samples after a gap
        until the filters have settled. It is True at all other samples.
        """
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
