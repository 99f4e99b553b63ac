"""Online estimates of a record that is processed in blocks: their summaries, and kept samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from estimation import Bank, Estimates, Excitation, Misfit, Regression
from estimation.compiled import Floats
from estimation.estimate_columns import estimate_arrays, estimate_columns, misfit_columns
from estimation.estimator import Series
from estimation.summary import EstimatorSummary, RunningSummary
from teleop.evaluation.conditioned import Conditioned
from teleop.evaluation.model_comparison import Comparison, RunningComparison

Table = tuple[dict[str, Floats], dict[str, str]]
"""Columns of shape (n,) by name, and the unit of each column."""


class OnlineResult(NamedTuple):
    """Samples and estimates of a record: all samples, or evenly spaced samples, and the last."""

    t: Floats
    """Time [s], shape (kept,)."""
    regression: Regression
    estimates: dict[str, Estimates]
    misfit: dict[str, Floats]
    excitation: Floats
    summaries: dict[str, EstimatorSummary]
    """Summary of each estimator over all samples."""
    comparisons: dict[str, Comparison]
    """Comparison of the estimators with the reference over all samples."""
    used: int
    """Number of all samples."""
    mean_excitation: float
    longest_period: float
    """Longest time between two samples [s]."""
    largest_deviation: float
    """Largest difference between a sample period and the usual period, without gaps [s]."""
    as_recorded: bool
    """Whether all estimates are equal to the recorded estimates, to the bit."""


class OnlineRun:
    """Applies a bank of estimators to a record in blocks.

    Parameters
    ----------
    bank, misfit, measure
        The estimators, their misfit and the excitation measure, which have processed no sample.
    comparisons
        Comparisons with a reference; each has some of the estimators.
    period
        Usual sample period [s].
    every
        Distance of the samples that are kept; 1 to keep all samples.
    write
        Function that is called with the table of each block; None for none.
    """

    def __init__(
        self,
        bank: Bank,
        misfit: Misfit,
        measure: Excitation,
        comparisons: Sequence[RunningComparison],
        period: float,
        every: int = 1,
        write: Callable[[Table], None] | None = None,
    ) -> None:
        self._bank, self._misfit, self._measure = bank, misfit, measure
        self._comparisons = comparisons
        self._period, self._every, self._write = period, every, write
        self._summaries = {name: RunningSummary(e) for name, e in bank.items()}
        self._kept: list[Kept] = []
        self._used = 0
        self._excitation = self._longest = self._deviation = 0.0
        self._as_recorded = True

    def add(self, samples: Conditioned, recorded: Mapping[str, tuple[Floats, Floats]]) -> None:
        """Process the next samples.

        Parameters
        ----------
        samples
            The conditioned samples.
        recorded
            Recorded b and k of each estimator after each sample, see `Block`.
        """
        t, regression, used, apart = samples
        if not len(t):
            return
        excitation = self._measure.run(regression.x, regression.v, regression.dt)
        within = np.delete(regression.dt, apart)
        self._excitation += float(np.sum(excitation))
        self._longest = max(self._longest, float(np.max(regression.dt)))
        self._deviation = max(
            self._deviation, float(np.max(np.abs(within - self._period), initial=0.0))
        )
        self._as_recorded &= list(recorded) == list(self._bank)
        for comparison in self._comparisons:
            comparison.begin(regression)
        places = np.arange(-self._used % self._every, len(t), self._every)
        whole: Kept = Kept(t, regression, {}, {}, excitation)
        last = np.array([len(t) - 1])
        parts = [whole.part(places), whole.part(last)]
        ends = None
        for i, (name, series) in enumerate(self._bank.each(*regression)):
            ends = ends or self._misfit.ends(regression, self._bank.opened)
            values = self._misfit.series(i, ends, series)
            self._summaries[name].add(t, regression, series, values)
            for comparison in self._comparisons:
                comparison.add(name, series)
            if self._as_recorded:
                self._as_recorded = all(
                    np.array_equal(ours, theirs[used], equal_nan=True)
                    for ours, theirs in zip(series[:2], recorded[name], strict=True)
                )
            for part, indices in zip(parts, (places, last), strict=True):
                part.estimates[name] = at(series, indices)
                part.misfit[name] = values[indices]
            if self._write:
                whole.estimates[name], whole.misfit[name] = series, values
        if self._write:
            self._write(table(self._bank, whole))
        self._used += len(t)
        self._kept = [*self._kept[:-1], *parts]

    def result(self) -> OnlineResult:
        """Return the estimates and their summaries."""
        if (self._used - 1) % self._every == 0:
            self._kept.pop()
        kept = joined(self._kept)
        comparisons = [comparison.result() for comparison in self._comparisons]
        return OnlineResult(
            *kept[:2],
            kept.estimates,
            kept.misfit,
            kept.excitation,
            {name: one.summary(kept.estimates[name]) for name, one in self._summaries.items()},
            {name: row for rows in comparisons for name, row in rows.items()},
            self._used,
            self._excitation / self._used,
            self._longest,
            self._deviation,
            self._as_recorded,
        )


class Kept(NamedTuple):
    """Some samples with their estimates."""

    t: Floats
    regression: Regression
    estimates: dict[str, Estimates]
    misfit: dict[str, Floats]
    excitation: Floats

    def part(self, indices: np.ndarray) -> Kept:
        """Return the samples with these indices, without estimates."""
        excitation = self.excitation[indices]
        return Kept(self.t[indices], self.regression.part(indices), {}, {}, excitation)


def at(estimates: Estimates, indices: np.ndarray) -> Estimates:
    """Return the estimates after the samples with these indices."""
    further = {
        name: Series(*(values[indices] for values in series))
        for name, series in estimates.further.items()
    }
    b, k, b_std, k_std, held = (values[indices] for values in estimates[:5])
    return Estimates(b, k, b_std, k_std, held, further)


def joined(parts: Sequence[Kept]) -> Kept:
    """Join the samples of several parts, and remove the estimates from the parts."""
    first = parts[0]
    if len(parts) == 1:
        return first
    estimates = {
        name: joined_estimates([part.estimates.pop(name) for part in parts])
        for name in list(first.estimates)
    }
    regressions = (part.regression for part in parts)
    return Kept(
        np.concatenate([part.t for part in parts]),
        Regression(*(np.concatenate(channel) for channel in zip(*regressions, strict=True))),
        estimates,
        {name: np.concatenate([part.misfit[name] for part in parts]) for name in first.misfit},
        np.concatenate([part.excitation for part in parts]),
    )


def joined_estimates(parts: Sequence[Estimates]) -> Estimates:
    """Join the estimates of one estimator after the samples of several parts."""
    further = {
        name: Series(
            np.concatenate([part.further[name].value for part in parts]),
            np.concatenate([part.further[name].std for part in parts]),
        )
        for name in parts[0].further
    }
    b, k, b_std, k_std = (
        np.concatenate([(p.b, p.k, p.b_std, p.k_std)[i] for p in parts]) for i in range(4)
    )
    return Estimates(b, k, b_std, k_std, np.concatenate([part.held for part in parts]), further)


def table(bank: Bank, kept: Kept) -> Table:
    """Return signals and estimates as columns of shape (n,), and the unit of each column."""
    x, v, f, *_ = kept.regression
    columns = {"Time": kept.t, "Displacement": x, "Velocity": v, "Force": f}
    units = {"Time": "s", "Displacement": "m", "Velocity": "m/s", "Force": "N"}
    columns["Excitation"], units["Excitation"] = kept.excitation, "-"
    for column, values in zip(estimate_columns(bank), estimate_arrays(kept.estimates), strict=True):
        columns[column.name] = np.asarray(values, dtype=np.float64)
        units[column.name] = column.unit
    for column, values in zip(misfit_columns(bank), kept.misfit.values(), strict=True):
        columns[column.name], units[column.name] = values, column.unit
    return columns, units
