"""Averages of estimates over a part of a record that is processed in blocks."""

from __future__ import annotations

import math
from collections.abc import Mapping

from estimation import Bank, Estimates, ExpectedHalfWidths, Regression
from estimation.arrays import Floats
from estimation.summary import EstimatorSummary, RunningSummary
from teleop.evaluation.settings import AveragedPart


class RunningAverages:
    """Averages of the estimates over a part of a record.

    The record is processed in blocks of samples. For each block, call `begin` once, and then `add`
    for each estimator.

    Attributes
    ----------
    samples
        Number of samples in the averaged part that were added so far.
    expected
        Half widths of the intervals that motion and noise permit, after the last of these samples.
    """

    def __init__(self, bank: Bank, averaged: AveragedPart) -> None:
        self.samples = 0
        self.expected = ExpectedHalfWidths(math.nan, math.nan)
        self._averaged = averaged
        self._summaries = {name: RunningSummary(estimator) for name, estimator in bank.items()}

    def begin(self, t: Floats, regression: Regression, expected: tuple[Floats, Floats]) -> None:
        """Begin a block of n samples. `expected` are the expected half widths of k and b."""
        self._part = part = self._averaged.indices(t)
        self._block = t[part], regression.part(part)
        self.samples += len(self._block[0])
        if len(self._block[0]):
            self.expected = ExpectedHalfWidths(*(float(one[part][-1]) for one in expected))

    def add(self, name: str, estimates: Estimates, misfit: Floats) -> None:
        """Add the estimates of one estimator for the block that the last call of `begin` began."""
        self._summaries[name].add(*self._block, estimates.part(self._part), misfit[self._part])

    def summaries(
        self, t: Floats, estimates: Mapping[str, Estimates]
    ) -> dict[str, EstimatorSummary]:
        """Return averages, errors and last estimates of each estimator, by its name.

        They are computed from all samples that were added. The parameters are used only for the
        remark of an estimator on its estimates.
        """
        part = self._averaged.indices(t)
        return {
            name: one.summary(estimates[name].part(part)) for name, one in self._summaries.items()
        }
