"""Condition the evaluated part of a record, relative to the datum, in each piece between gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.averaged_part import AveragedPart
from teleop.evaluation.datum import Datum
from teleop.evaluation.sampling_gaps import condition
from teleop.evaluation.signals import Signals

FEWEST = 10
"""Smallest number of moving samples that are evaluated."""


class Conditioned(NamedTuple):
    """The samples that the estimators receive."""

    t: Floats
    """Time [s], shape (n,)."""
    regression: Regression
    """The conditioned samples. The first `dt` after omitted samples includes the time of these
    samples."""
    used: NDArray[np.intp]
    """Index of each sample in the record, shape (n,)."""
    apart: NDArray[np.intp]
    """Index of each sample that follows omitted samples."""


def conditioned(
    conditioner: Conditioner, signals: Signals, datum: Datum, motion: slice = slice(None)
) -> Conditioned:
    """Condition a record, and omit the samples after each gap until the filters have settled.

    Parameters
    ----------
    conditioner
        The filters that condition the signals.
    signals
        The record.
    datum
        Position and force that are treated as zero.
    motion
        Part of the record that is evaluated.

    Raises
    ------
    InputError
        Too few samples remain between the gaps.
    """
    t = signals.t
    whole, settled = condition(
        conditioner, t, signals.x - datum.x, signals.f - datum.f, signals.dt, signals.gaps
    )
    moving = np.arange(len(t))[motion]
    used = moving[settled[moving]]
    if len(used) < FEWEST:
        raise InputError(
            f"only {len(used)} samples are far enough from a gap for the filters to settle: "
            f"expected at least {FEWEST}"
        )
    regression = whole.part(used)
    apart = 1 + np.flatnonzero(np.diff(used) > 1)
    regression.dt[apart] = t[used][apart] - t[used][apart - 1]
    return Conditioned(t[used], regression, used, apart)


def within(signals: Signals, part: AveragedPart) -> Signals:
    """Return the samples in a part of a record.

    Raises
    ------
    InputError
        The part has fewer than `FEWEST` samples.
    """
    start, end = (int(i) for i in np.searchsorted(signals.t, part[:2]))
    if end - start < FEWEST:
        raise InputError(
            f"only {end - start} samples without {part.left_out}: expected at least {FEWEST}"
        )
    t, x, f, dt = (column[start:end] for column in signals[:4])
    gaps = tuple(gap - start for gap in signals.gaps if start < gap < end)
    return signals._replace(t=t, x=x, f=f, dt=dt, gaps=gaps)
