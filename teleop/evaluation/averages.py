"""Averages of estimates and excitation over a part of a record that is processed in blocks."""

from __future__ import annotations

import math
from collections.abc import Mapping

from estimation import Bank, Estimates, Regression
from estimation.compiled import Floats
from estimation.summary import EstimatorSummary, RunningSummary
from teleop.evaluation.averaged_part import AveragedPart


class RunningAverages:
    """Averages of the estimates and of the excitation of a bank of estimators.

    Call `begin` for each block of samples, and then `add` for each estimator.

    Parameters
    ----------
    bank
        The estimators.
    averaged
        The part of the record over which the estimates are averaged.

    Attributes
    ----------
    samples
        Number of samples in this part.
    last_excitation
        Excitation after the last sample of this part; NaN if there is no sample.
    """

    def __init__(self, bank: Bank, averaged: AveragedPart) -> None:
        self.samples = 0
        self.last_excitation = math.nan
        self._averaged = averaged
        self._excitation = 0.0
        self._summaries = {name: RunningSummary(estimator) for name, estimator in bank.items()}

    @property
    def mean_excitation(self) -> float:
        """Mean excitation; NaN if there is no sample."""
        return self._excitation / self.samples if self.samples else math.nan

    def begin(self, t: Floats, regression: Regression, excitation: Floats) -> None:
        """Begin a block, and add its samples and their excitation.

        Parameters
        ----------
        t
            Time of each sample [s], shape (n,).
        regression
            The n samples that the estimators processed.
        excitation
            Excitation after each sample, shape (n,).
        """
        self._part = part = self._averaged.indices(t)
        self._block = t[part], regression.part(part)
        self.samples += len(self._block[0])
        self._excitation += float(excitation[part].sum())
        if len(self._block[0]):
            self.last_excitation = float(excitation[part][-1])

    def add(self, name: str, estimates: Estimates, misfit: Floats) -> None:
        """Add the estimates and the misfit of one estimator after each sample of the block."""
        self._summaries[name].add(*self._block, estimates.part(self._part), misfit[self._part])

    def summaries(
        self, t: Floats, estimates: Mapping[str, Estimates]
    ) -> dict[str, EstimatorSummary]:
        """Return a summary of each estimator.

        Parameters
        ----------
        t
            Times of all samples, or of evenly spaced samples [s], shape (m,).
        estimates
            The estimates at these times, by the name of the estimator.
        """
        part = self._averaged.indices(t)
        return {
            name: one.summary(estimates[name].part(part)) for name, one in self._summaries.items()
        }
