"""Averages of estimates and excitation over a part of a record that is processed in blocks."""

from __future__ import annotations

import math
from collections.abc import Mapping

from estimation import Bank, Estimates, Regression
from estimation.arrays import Floats
from estimation.summary import EstimatorSummary, RunningSummary
from teleop.evaluation.settings import AveragedPart


class RunningAverages:
    """Averages of the estimates and of the excitation over a part of a record.

    The record is processed in blocks of samples. For each block, call `begin` once, and then `add`
    for each estimator. The excitation is a number from 0 to 1. It is near 0 if k and b cannot both
    be identified from the motion (`estimation.excitation`).

    Attributes
    ----------
    samples
        Number of samples in the averaged part that were added so far.
    last_excitation
        Excitation after the last of these samples; NaN if there is no sample.
    """

    def __init__(self, bank: Bank, averaged: AveragedPart) -> None:
        self.samples = 0
        self.last_excitation = math.nan
        self._averaged = averaged
        self._excitation = 0.0
        self._summaries = {name: RunningSummary(estimator) for name, estimator in bank.items()}

    @property
    def mean_excitation(self) -> float:
        """Mean of the excitation over the samples that were added; NaN if there is no sample."""
        return self._excitation / self.samples if self.samples else math.nan

    def begin(self, t: Floats, regression: Regression, excitation: Floats) -> None:
        """Begin a block of n samples, and add the excitation of these samples to its mean."""
        self._part = part = self._averaged.indices(t)
        self._block = t[part], regression.part(part)
        self.samples += len(self._block[0])
        self._excitation += float(excitation[part].sum())
        if len(self._block[0]):
            self.last_excitation = float(excitation[part][-1])

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
