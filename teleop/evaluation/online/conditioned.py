"""Condition the samples of a record for the estimators: subtract the datum, and filter.

If samples are missing in the record (gaps), each piece between two gaps is filtered separately.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Conditioner, Regression
from estimation.arrays import Floats
from teleop.errors import InputError
from teleop.evaluation.online.datum import Datum
from teleop.evaluation.online.thresholds import FEWEST_SAMPLES
from teleop.evaluation.reading.signals import Signals
from teleop.evaluation.settings import AveragedPart

LONGEST_DELAY = 0.5
"""Longest delay of the filters that is tried, as a multiple of 1 / bandwidth."""
DELAYS = 26
"""Number of delays of the filters that are tried."""
MOST_SAMPLES = 20_000
"""Approximate largest number of samples of which the variance is computed."""


def kept_variance(
    raw: Floats, conditioned: Floats, used: NDArray[np.intp], bandwidth: float
) -> float:
    """Return the fraction of the variance of a signal that filters keep, from 0 to 1.

    Let y be the filtered signal, and r(d) the measured signal with a delay of d samples. The
    filters remove r(d) - y from the signal. The result is

        var(y) / (var(y) + var(r(d) - y)).

    The filters delay the signal by an unknown number of samples. Therefore, several delays d are
    tried, and the delay for which var(r(d) - y) is smallest is used.
    """
    step = max(1, len(used) // MOST_SAMPLES)
    used, kept = used[::step], conditioned[::step]
    delays = np.unique(np.linspace(0.0, LONGEST_DELAY / bandwidth, DELAYS).round().astype(np.intp))
    removed = min(float(np.var(raw[np.maximum(used - d, 0)] - kept)) for d in delays)
    variance = float(np.var(kept))
    return variance / max(variance + removed, 1e-300)


class ConditionedSamples(NamedTuple):
    """The samples that the estimators receive: filtered, and relative to the datum."""

    t: Floats
    """Time [s], shape (n,)."""
    regression: Regression
    """Displacement, velocity, force and sample period `dt` of the n samples. After omitted samples,
    `dt` is the whole time since the last sample that was not omitted."""
    used: NDArray[np.intp]
    """Index of each sample in the record, shape (n,)."""
    apart: NDArray[np.intp]
    """Which of the n samples follow omitted samples: their indices, from 0 to n - 1."""


def conditioned(
    conditioner: Conditioner, signals: Signals, datum: Datum, motion: slice = slice(None)
) -> ConditionedSamples:
    """Filter a record, and omit the samples after each gap until the filters have settled.

    A gap is a time in which samples are missing. After each gap, the filters start again.
    """
    found = ConditionedBlocks(conditioner, datum, motion).add(signals)
    if len(found.used) < FEWEST_SAMPLES:
        raise InputError(
            f"only {len(found.used)} samples are far enough from a gap for the filters to settle: "
            f"expected at least {FEWEST_SAMPLES}"
        )
    return found


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


class ConditionedBlocks:
    """Filters a record for the estimators, one block of samples after another.

    The results are the same as those of `conditioned`, which filters the whole record in one call.
    The datum is subtracted from position and force. Only the samples in `motion` are used.
    """

    def __init__(self, conditioner: Conditioner, datum: Datum, motion: slice = slice(None)) -> None:
        self._pieces = PiecewiseConditioner(conditioner)
        self._datum, self._motion = datum, motion
        self._count = 0
        self._last: tuple[int, float] | None = None

    def add(self, signals: Signals) -> ConditionedSamples:
        """Filter the next block of samples, and return the filtered samples.

        In the result, the indices in `ConditionedSamples.used` are relative to the first sample of
        this block, not to the first sample of the record.
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
        return ConditionedSamples(t[used], regression, used, apart)


def within(signals: Signals, part: AveragedPart) -> Signals:
    """Return the samples of a record that are in a part of it."""
    chosen = part.indices(signals.t)
    start, end = chosen.start, chosen.stop
    if end - start < FEWEST_SAMPLES:
        raise InputError(
            f"only {end - start} samples without {part.left_out}: "
            f"expected at least {FEWEST_SAMPLES}"
        )
    t, x, f, dt = (column[chosen] for column in signals[:4])
    gaps = tuple(gap - start for gap in signals.gaps if start < gap < end)
    return signals._replace(t=t, x=x, f=f, dt=dt, gaps=gaps)
