"""Condition the samples of a record for the estimators.

Position and force are measured from the datum. If the record has gaps, each piece between two gaps
is conditioned separately.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.compiled import Floats
from teleop.errors import InputError
from teleop.evaluation.averaged_part import AveragedPart
from teleop.evaluation.datum import Datum
from teleop.evaluation.sampling_gaps import PiecewiseConditioner
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
    """Index, in the conditioned samples, of each sample that follows omitted samples."""


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
    found = ConditionedBlocks(conditioner, datum, motion).add(signals)
    if len(found.used) < FEWEST:
        raise InputError(
            f"only {len(found.used)} samples are far enough from a gap for the filters to settle: "
            f"expected at least {FEWEST}"
        )
    return found


class ConditionedBlocks:
    """Conditions a record that is read in blocks, see `conditioned`."""

    def __init__(self, conditioner: Conditioner, datum: Datum, motion: slice = slice(None)) -> None:
        self._pieces = PiecewiseConditioner(conditioner)
        self._datum, self._motion = datum, motion
        self._count = 0
        self._last: tuple[int, float] | None = None

    def add(self, signals: Signals) -> Conditioned:
        """Condition the next samples of the record, and return the conditioned samples.

        The indices in `Conditioned.used` count from the first sample of `signals`, and not from the
        first sample of the record.
        """
        t, datum = signals.t, self._datum
        whole, settled = self._pieces.run(
            t, signals.x - datum.x, signals.f - datum.f, signals.dt, signals.gaps
        )
        start, stop, _ = self._motion.indices(self._count + len(t))
        moving = np.arange(max(start - self._count, 0), max(stop - self._count, 0))
        used = moving[settled[moving]]
        regression = whole.part(used)
        times, places = t[used], used + self._count
        if self._last:
            places = np.concatenate([self._last[:1], places])
            times = np.concatenate([self._last[1:], times])
        apart = 1 + np.flatnonzero(np.diff(places) > 1)
        periods = times[apart] - times[apart - 1]
        apart -= 1 if self._last else 0
        regression.dt[apart] = periods
        self._count += len(t)
        if len(used):
            self._last = int(places[-1]), float(times[-1])
        return Conditioned(t[used], regression, used, apart)


def within(signals: Signals, part: AveragedPart) -> Signals:
    """Return the samples in a part of a record.

    Raises
    ------
    InputError
        The part has fewer than `FEWEST` samples.
    """
    chosen = part.indices(signals.t)
    start, end = chosen.start, chosen.stop
    if end - start < FEWEST:
        raise InputError(
            f"only {end - start} samples without {part.left_out}: expected at least {FEWEST}"
        )
    t, x, f, dt = (column[chosen] for column in signals[:4])
    gaps = tuple(gap - start for gap in signals.gaps if start < gap < end)
    return signals._replace(t=t, x=x, f=f, dt=dt, gaps=gaps)
