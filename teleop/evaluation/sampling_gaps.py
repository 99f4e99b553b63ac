"""Gaps between samples, and the conditioning of signals across them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.compiled import Floats

LONG = 20.0
"""A sample period longer than this many median periods is a gap."""


def long_periods(dt: Floats) -> NDArray[np.intp]:
    """Return the indices of the samples before which there is a gap."""
    return np.flatnonzero(dt > LONG * np.median(dt))


def closed_up(dt: Floats, gaps: Sequence[int]) -> Floats:
    """Return the sample periods with the median period in place of each gap.

    Parameters
    ----------
    dt
        Time since the sample before [s], shape (n,).
    gaps
        Indices of the samples before which samples are missing.
    """
    periods = dt.copy()
    periods[list(gaps)] = np.median(dt)
    return periods


def condition(
    conditioner: Conditioner,
    t: Floats,
    x: Floats,
    f: Floats,
    dt: Floats,
    gaps: Sequence[int],
) -> tuple[Regression, NDArray[np.bool_]]:
    """Condition the signals between gaps.

    Parameters
    ----------
    conditioner
        Is reset at each gap.
    t, x, f, dt
        Time [s], position [m], force [N] and time since the sample before [s], each of shape
        (n,).
    gaps
        Indices of the samples before which samples are missing.

    Returns
    -------
    The regression, and whether the filters have settled since the last gap, both of n samples.
    """
    bounds = sorted({0, len(t), *gaps})
    settled = np.ones(len(t), dtype=np.bool_)
    parts = []
    for start, end in pairwise(bounds):
        conditioner.reset()
        parts.append(conditioner.run(x[start:end], f[start:end], dt[start:end]))
        if start in gaps:
            settled[start:end] = t[start:end] - t[start] > conditioner.settling
    return Regression(*(np.concatenate(channel) for channel in zip(*parts, strict=True))), settled
