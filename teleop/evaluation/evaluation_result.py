"""The results of the evaluation of one recording."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from estimation import (
    Bank,
    Estimates,
    Fit,
    Preset,
    Regression,
)
from estimation.batch_models import BatchFit
from estimation.compiled import Floats
from estimation.presentation import Presented
from estimation.summary import EstimatorSummary
from teleop.evaluation.analysis import Analysis
from teleop.evaluation.averaged_part import WHOLE, AveragedPart
from teleop.evaluation.conditioned import Conditioned
from teleop.evaluation.datum import Datum
from teleop.evaluation.model_comparison import cost as sample_cost
from teleop.evaluation.online import OnlineResult
from teleop.evaluation.reason import Reason

FEWEST_KEPT = 0.9
"""A message is reported if the conditioning keeps less than this fraction of the force variance."""
LEAST_EXCITATION = 0.01
"""Excitation below which a remark on b of the online estimators is reported.

Below this excitation, the standard deviation of b omega is more than ten times that of k. If k is
known to 10 %, a loss tangent b omega / k below one can then not be measured.
"""


@dataclass(frozen=True, repr=False)
class Evaluation(Presented):
    """Online estimates and batch evaluation of one recording.

    Arrays have shape (n,), where n is the number of samples whose estimates are kept. These are all
    samples that the estimators processed, or evenly spaced samples of a long record (see
    `evaluate`). The summaries are always computed from all samples in the part `averaged`.
    """

    online: OnlineResult
    """The online estimates."""
    sampled: Conditioned
    """The conditioned samples of `Samples.signals`: all samples, or sections of a long record."""
    bank: Bank
    least_squares: Fit
    """Least-squares fit to the samples `sampled`; NaN without contact."""
    datum: Datum
    preset: Preset
    bandwidth: float
    rate: float
    """Sampling rate: inverse of the median sample period [Hz]."""
    jitter: float
    """Largest deviation of a sample period from the median, as a fraction of the median."""
    samples: int
    """Number of samples in the recording, including those at rest."""
    batch_samples: int
    """Number of samples of the batch evaluation."""
    in_sections: bool
    """Whether the batch evaluation uses only some sections of a long recording."""
    analysis: Analysis
    """The batch evaluation."""
    kept_force_variance: float
    """Fraction of the variance of the force that the conditioning keeps, from 0 to 1."""
    filter_note: Reason | None
    """How the delay of the force filter was compensated, or why it was not; None if the file states
    no filter with delay, or if the settings state the lag."""
    gaps: tuple[tuple[float, float], ...] = ()
    """Time of the last sample before each gap, and of the first sample after the gap [s]."""
    averaged: AveragedPart = WHOLE
    """The part of the record over which the online estimates are averaged."""

    @property
    def t(self) -> Floats:
        """Time [s], shape (n,)."""
        return self.online.t

    @property
    def regression(self) -> Regression:
        """The conditioned samples, which are the input of the estimators."""
        return self.online.regression

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Estimates after each sample, by the name of the estimator."""
        return self.online.estimates

    @property
    def misfit(self) -> dict[str, Floats]:
        """Misfit of each estimator (`estimation.misfit`), arrays of shape (n,)."""
        return self.online.misfit

    @property
    def excitation(self) -> Floats:
        """Excitation at each sample (`estimation.excitation`), from 0 at rest to 1, shape (n,)."""
        return self.online.excitation

    def summary(self, cost: bool = False) -> dict[str, Any]:
        """Return the results with the keys of the output of `teleop estimate --json`.

        Parameters
        ----------
        cost
            Whether to measure the computing time of each estimator per sample. The measured time is
            different in each call.
        """
        estimates = {name: one._asdict() for name, one in self.summaries().items()}
        for name, row in self.online.comparisons.items():
            estimates[name] |= row._asdict()
        if cost:
            for name in estimates:
                estimates[name]["cost_us"] = (
                    sample_cost(self.bank[name], self.sampled.regression) * 1e6
                )
        return {
            **self.batch_summary(),
            "samples": self.samples,
            "samples_used": self.online.used,
            "rate_hz": self.rate,
            "jitter": self.jitter,
            "longest_gap_s": self.online.longest_period,
            "gaps": [{"from_s": start, "to_s": end} for start, end in self.gaps],
            "from_s": round(float(self.t[0]), 9) + 0.0,
            "to_s": float(self.t[-1]),
            "datum": {
                "position_m": self.datum.x,
                "force_n": self.datum.f,
                "source": self.datum.source,
            },
            "model": self.preset.model.name,
            "own_model": [name for name, e in self.bank.items() if e.model != self.preset.model],
            "from_contact": [name for name, e in self.bank.items() if e.from_contact],
            "bandwidth_hz": self.bandwidth,
            "memory_s": 0.5 / self.preset.forgetting_rate,
            "left_out": self.averaged.left_out,
            "excitation": {
                "mean": self.online.mean_excitation,
                "last": self.online.last_excitation,
            },
            "estimates": estimates,
            "least_squares": self.least_squares.summary(self.preset.model.further),
        }

    def summaries(self) -> dict[str, EstimatorSummary]:
        """Return a summary of the estimates of each estimator, by the name of the estimator."""
        return self.online.summaries

    @cached_property
    def models(self) -> list[BatchFit]:
        """The models of the batch evaluation, relative to the datum, the best first."""
        return self.analysis.models(self.datum.x, self.datum.f)

    def batch_summary(self) -> dict[str, Any]:
        """Return the result, the models and the phases as a dictionary for JSON."""
        result = self.analysis.result
        reasons, hints = list(result.reasons), list(result.hints)
        excitation = float(np.percentile(self.excitation, 95))
        if excitation < LEAST_EXCITATION:
            reasons.append(
                f"the excitation of the online estimators is {excitation:.1g} at most: below "
                f"{LEAST_EXCITATION:g} they cannot separate b from k"
            )
        if self.in_sections:
            reasons.append(
                f"the record is long: result and models are those of {self.batch_samples} of "
                f"{self.samples} samples, in evenly spaced sections"
            )
        if self.filter_note:
            reasons.append(self.filter_note.text)
            hints.append(self.filter_note.hint)
        if self.kept_force_variance < FEWEST_KEPT:
            reasons.append(
                f"conditioning at {self.bandwidth:.3g} Hz keeps {self.kept_force_variance:.0%} of "
                "the force variance: the online estimates describe that part only"
            )
        identified = [fit.name for fit in self.models if fit.identifiable]
        best = identified[0] if identified and result.identifiable else None
        return {
            "result": {**result.summary(), "reasons": reasons, "hints": hints},
            "best_model": best,
            "models": [fit.summary() for fit in self.models],
            **self.analysis.summary(),
            "kept_force_variance": self.kept_force_variance,
        }
