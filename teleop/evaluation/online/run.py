"""Run the online estimators over a record in blocks, and summarise their estimates.

An online estimator updates its estimates after each sample. If the record is long, the estimates
are kept in memory only at evenly spaced samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Bank, Estimates, ExpectedHalfWidths, ExpectedIntervals, Misfit, Regression
from estimation.arrays import Floats
from estimation.estimate_columns import estimate_arrays, estimate_columns, misfit_columns
from estimation.estimator import Series
from estimation.summary import EstimatorSummary
from teleop.evaluation.online.averages import RunningAverages
from teleop.evaluation.online.conditioned import ConditionedSamples
from teleop.evaluation.online.model_comparison import Comparison, RunningComparison
from teleop.evaluation.settings import WHOLE, AveragedPart

MISFIT, FURTHER, EXPECTED = "misfit", "further", "expected"
"""Words in the keys of the arrays in `KeptArrays`. They denote the misfit of an estimator (the
systematic part of its force error), its parameters besides b and k, and the half widths of the
intervals that motion and noise permit."""
Table = tuple[dict[str, Floats], dict[str, str]]
"""Columns of shape (n,) by name, and the unit of each column."""


class ExpectedSeries(NamedTuple):
    """Expected half widths of k and b after each of n samples, each of shape (n,)."""

    k: Floats
    b: Floats


class OnlineResult(NamedTuple):
    """Results of the online estimators for a record.

    The estimators process all samples of the record. For a long record, the arrays contain only
    evenly spaced samples and the last sample. In the shapes, `kept` is the number of these samples.
    """

    t: Floats
    """Time [s], shape (kept,)."""
    regression: Regression
    """Displacement, velocity, force and sample period of the kept samples."""
    estimates: dict[str, Estimates]
    """Estimates after each kept sample, by the name of the estimator."""
    misfit: dict[str, Floats]
    """Systematic part of the force error, relative to the force (`estimation.misfit`), by the name
    of the estimator. Each array has the shape (kept,)."""
    expected_series: ExpectedSeries
    """Half widths of the 95 % intervals of k and b that motion and noise permit, as fractions."""
    summaries: dict[str, EstimatorSummary]
    """Summary of each estimator over all samples in the part of the record that is averaged."""
    comparisons: dict[str, Comparison]
    """Errors of each compared estimator relative to a reference, over all samples."""
    used: int
    """Number of samples that the estimators processed."""
    expected: ExpectedHalfWidths
    """The same after the last sample of the averaged part; NaN if there is no sample."""
    longest_period: float
    """Longest time between two successive samples, including gaps [s]."""
    largest_deviation: float
    """Largest difference between a sample period and the usual sample period [s]. Gaps are not
    counted."""
    as_recorded: bool
    """Whether all estimates are exactly equal to the estimates that were recorded in the trial.
    False if no estimates were recorded."""
    unrecorded: int
    """Number of samples without recorded estimates, although others have them: the estimates were
    late, or an estimator had failed."""


class OnlineRun:
    """Runs several estimators over a record that is processed in blocks of samples.

    Call `add` for each block, and then `result`. Bank, misfit and expected intervals have not yet
    processed a sample. `period` is the usual sample period [s], and `count` the largest
    number of samples. Every `every`-th estimate is kept in memory. `write` gets all of them.
    """

    def __init__(
        self,
        bank: Bank,
        misfit: Misfit,
        expected: ExpectedIntervals,
        comparisons: Sequence[RunningComparison],
        period: float,
        count: int,
        every: int = 1,
        write: Callable[[Table], None] | None = None,
        averaged: AveragedPart = WHOLE,
    ) -> None:
        self._bank, self._misfit, self._expected = bank, misfit, expected
        self._comparisons = comparisons
        self._period, self._every, self._write = period, every, write
        self._averages = RunningAverages(bank, averaged)
        self._kept = KeptArrays(math.ceil(count / every) + 1)
        self._used = self._kept_samples = 0
        self._longest = self._deviation = 0.0
        self._as_recorded, self._unrecorded = True, 0

    def add(
        self, samples: ConditionedSamples, recorded: Mapping[str, tuple[Floats, Floats]]
    ) -> None:
        """Run the estimators over the next block of samples.

        `recorded` are the b and k that a trial recorded after each sample of the block, before
        samples were omitted.
        """
        t, regression, used, apart = samples
        if not len(t):
            return
        within = np.delete(regression.dt, apart)
        self._longest = max(self._longest, float(np.max(regression.dt)))
        self._deviation = max(
            self._deviation, float(np.max(np.abs(within - self._period), initial=0.0))
        )
        self._as_recorded &= list(recorded) == list(self._bank)
        if recorded:
            values = np.array(list(recorded.values()))[:, :, used]
            self._unrecorded += int(np.isnan(values).all(axis=(0, 1)).sum())
        for comparison in self._comparisons:
            comparison.begin(regression)
        places = np.arange(-self._used % self._every, len(t), self._every)
        kept, start = self._kept, self._kept_samples
        # The last sample of the block is overwritten if there is another block.
        chosen = np.concatenate([places, [len(t) - 1]])
        kept.put(start, ("t",), t[chosen])
        for field, channel in zip(Regression._fields, regression.part(chosen), strict=True):
            kept.put(start, (field,), channel)
        estimates: dict[str, Estimates] = {}
        misfit: dict[str, Floats] = {}
        ends, expected = None, ExpectedSeries(t, t)
        for i, (name, series) in enumerate(self._bank.each(*regression)):
            if ends is None:  # the first estimator: the gate of the bank is now known
                ends = self._misfit.ends(regression, self._bank.opened)
                x, v, f, dt, _ = regression
                expected = ExpectedSeries(*self._expected.run(x, v, f, dt, self._bank.opened))
                self._averages.begin(t, regression, expected)
                for part, values in expected._asdict().items():
                    kept.put(start, (EXPECTED, part), values[chosen])
            values = self._misfit.series(i, ends, series)
            self._averages.add(name, series, values)
            for comparison in self._comparisons:
                comparison.add(name, series)
            if self._as_recorded:
                self._as_recorded = all(
                    np.array_equal(ours, theirs[used], equal_nan=True)
                    for ours, theirs in zip(series[:2], recorded[name], strict=True)
                )
            kept.put_estimates(start, name, series.part(chosen))
            kept.put(start, (name, MISFIT), values[chosen])
            if self._write:
                estimates[name], misfit[name] = series, values
        if self._write:
            self._write(table(self._bank, t, regression, estimates, misfit, expected))
        self._used += len(t)
        self._kept_samples += len(places)

    def result(self) -> OnlineResult:
        """Return the kept estimates, and the summaries and comparisons over all samples."""
        count = self._kept_samples + ((self._used - 1) % self._every != 0)
        kept = self._kept
        estimates = {name: kept.estimates(count, name) for name in self._bank}
        t = kept.get(count, "t")
        averages = self._averages
        rows = [comparison.result() for comparison in self._comparisons]
        return OnlineResult(
            t,
            Regression(*(kept.get(count, field) for field in Regression._fields)),
            estimates,
            {name: kept.get(count, name, MISFIT) for name in self._bank},
            ExpectedSeries(*(kept.get(count, EXPECTED, part) for part in ExpectedSeries._fields)),
            averages.summaries(t, estimates),
            {name: row for found in rows for name, row in found.items()},
            self._used,
            averages.expected,
            self._longest,
            self._deviation,
            self._as_recorded,
            self._unrecorded,
        )


class KeptArrays:
    """Stores quantities at selected samples of a record, one array for each quantity.

    The record is processed in blocks, and the arrays are filled block by block. Each array is
    created with space for all samples, because many short arrays would fragment the memory.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._arrays: dict[tuple[str, ...], NDArray[Any]] = {}

    def put(self, start: int, key: tuple[str, ...], values: NDArray[Any]) -> None:
        """Store successive values in the array of one quantity, from the index `start` on.

        The parameter `key` identifies the quantity. For a new key, a new array is created.
        """
        if key not in self._arrays:
            self._arrays[key] = np.empty((self._size, *values.shape[1:]), values.dtype)
        self._arrays[key][start : start + len(values)] = values

    def put_estimates(self, start: int, name: str, estimates: Estimates) -> None:
        """Store successive estimates of the estimator `name`, from the index `start` on.

        There is one array for each estimated parameter and each standard deviation.
        """
        for field, values in zip(Estimates._fields, estimates[:5], strict=False):
            self.put(start, (name, field), np.asarray(values))
        for parameter, series in estimates.further.items():
            self.put(start, (name, FURTHER, parameter, "value"), series.value)
            self.put(start, (name, FURTHER, parameter, "std"), series.std)

    def get(self, count: int, *key: str) -> NDArray[Any]:
        """Return the first `count` values of the array with the key `key`."""
        return self._arrays[key][:count]

    def estimates(self, count: int, name: str) -> Estimates:
        """Return the estimates of the estimator `name` after each of the first `count` samples."""
        parameters = [
            key[2] for key in self._arrays if key[:2] == (name, FURTHER) and key[-1] == "value"
        ]
        further = {
            parameter: Series(
                self.get(count, name, FURTHER, parameter, "value"),
                self.get(count, name, FURTHER, parameter, "std"),
            )
            for parameter in parameters
        }
        b, k, b_std, k_std, held = (self.get(count, name, f) for f in Estimates._fields[:5])
        return Estimates(b, k, b_std, k_std, held, further)


def table(
    bank: Bank,
    t: Floats,
    regression: Regression,
    estimates: dict[str, Estimates],
    misfit: dict[str, Floats],
    expected: ExpectedSeries,
) -> Table:
    """Return signals and estimates of n samples as columns, for an output file.

    The result consists of two dictionaries. Their keys are the names of the columns. The first
    contains the values, as arrays of shape (n,), and the second contains the units.
    """
    x, v, f, *_ = regression
    columns = {"Time": t, "Displacement": x, "Velocity": v, "Force": f}
    units = {"Time": "s", "Displacement": "m", "Velocity": "m/s", "Force": "N"}
    for part, values in expected._asdict().items():
        columns[f"Expected_{part}"], units[f"Expected_{part}"] = values, "-"
    for column, values in zip(estimate_columns(bank), estimate_arrays(estimates), strict=True):
        columns[column.name] = np.asarray(values, dtype=np.float64)
        units[column.name] = column.unit
    for column, values in zip(misfit_columns(bank), misfit.values(), strict=True):
        columns[column.name], units[column.name] = values, column.unit
    return columns, units
