"""Condition the part of a record that is evaluated, about its datum and between its gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.datum import Datum
from teleop.evaluation.sampling_gaps import condition
from teleop.evaluation.signals import Signals

FEWEST = 10
"""Fewest moving samples that are evaluated."""


class Conditioned(NamedTuple):
    """The samples that the estimators receive."""

    t: Floats
    """Time [s], shape (n,)."""
    regression: Regression
    """The conditioned samples. The first `dt` after left out samples includes their time."""
    used: NDArray[np.intp]
    """Index of each sample in the record, shape (n,)."""
    apart: NDArray[np.intp]
    """Index of each sample that follows left out samples."""


def conditioned(
    conditioner: Conditioner, signals: Signals, datum: Datum, motion: slice = slice(None)
) -> Conditioned:
    """Condition a record, and leave out the samples after a gap until the filters have settled.

    Parameters
    ----------
    conditioner
        The filters.
    signals
        The record.
    datum
        Position and force that count as zero.
    motion
        Part of the record that is used.

    Raises
    ------
    InputError
        Gaps leave too few samples.
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
