"""Define the results of the evaluation of one recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from estimation import (
    Bank,
    Estimates,
    Fit,
    Preset,
    Regression,
)
from estimation.arrays import Floats
from estimation.batch_models import BatchFit
from estimation.expected_intervals import LARGEST_EXPECTED, half_width_text
from estimation.presentation import Presented
from estimation.stiffening import Interval
from estimation.summary import EstimatorSummary
from teleop.evaluation.batch.analysis import Analysis
from teleop.evaluation.online.conditioned import ConditionedSamples
from teleop.evaluation.online.datum import Datum
from teleop.evaluation.online.model_comparison import cost as sample_cost
from teleop.evaluation.online.run import ExpectedSeries, OnlineResult
from teleop.evaluation.online.thresholds import LEAST_KEPT_VARIANCE
from teleop.evaluation.reason import Reason
from teleop.evaluation.settings import WHOLE, AveragedPart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from estimation.figures import Truth


@dataclass(frozen=True, repr=False)
class Evaluation(Presented):
    """Results of the online estimators and of the batch evaluation for one recording.

    Arrays have shape (n,), where n is the number of samples whose estimates are kept. For a short
    record, these are all samples that the estimators processed. For a long record, they are evenly
    spaced samples (see `evaluate`). The averages in the summaries are always computed from all
    samples in the part `averaged` of the recording.
    """

    online: OnlineResult
    """The online estimates."""
    sampled: ConditionedSamples
    """The conditioned samples of `Samples.signals`: all samples, or sections of a long record."""
    bank: Bank
    """The estimators."""
    least_squares: Fit
    """Least-squares fit to the samples `sampled`; NaN without contact."""
    datum: Datum
    """Position and force that are treated as zero."""
    preset: Preset
    """Parameters of the estimators."""
    bandwidth: float
    """Bandwidth of the filters that condition the signals [Hz]."""
    rate: float
    """Sampling rate: inverse of the median sample period [Hz]."""
    jitter: float
    """Largest deviation of a sample period from the median, as a fraction of the median."""
    samples: int
    """Number of samples in the recording, including those at rest."""
    batch_samples: int
    """Number of samples of the batch evaluation."""
    in_sections: bool
    """Whether the batch evaluation uses only sections of the recording, because it is long."""
    analysis: Analysis
    """The batch evaluation."""
    kept_force_variance: float
    """Fraction of the variance of the force that the conditioning keeps, from 0 to 1."""
    filter_note: Reason | None
    """Text on the delay of the force filter that the file states: how it was compensated, or why it
    was not. None if the file states no filter with delay, or if the settings state the lag."""
    gaps: tuple[tuple[float, float], ...] = ()
    """Time of the last sample before each gap, and of the first sample after the gap [s]."""
    averaged: AveragedPart = WHOLE
    """The part of the record over which the online estimates are averaged."""

    @property
    def t(self) -> Floats:
        """Time of each kept sample [s], shape (n,)."""
        return self.online.t

    @property
    def regression(self) -> Regression:
        """Filtered displacement, velocity and force at the kept samples, the estimators' input."""
        return self.online.regression

    @property
    def estimates(self) -> dict[str, Estimates]:
        """Estimates of k and b after each kept sample, by the name of the estimator."""
        return self.online.estimates

    @property
    def misfit(self) -> dict[str, Floats]:
        """Misfit of each estimator after each kept sample, by the name of the estimator.

        The misfit is the systematic part of the force error, divided by the force: 0 for a correct
        estimate, about 1 for the estimate b = k = 0 (`estimation.misfit`). Arrays have shape (n,).
        """
        return self.online.misfit

    @property
    def expected(self) -> ExpectedSeries:
        """Half widths of the 95 % intervals of k and b that motion and noise permit.

        Each has the shape (n,), and is a fraction of the value, from all samples until then
        (`estimation.ExpectedIntervals`).
        """
        return self.online.expected_series

    def plot(self, width: str = "screen", title: str = "", truth: Truth | None = None) -> Figure:
        """Return a figure of the estimated stiffness and damping, and of the motion, over time.

        k and b of the batch evaluation are drawn as horizontal lines with their 95 % intervals.
        Below the title, the figure states which estimators have a misfit above 5 %.

        Parameters
        ----------
        width, title, truth
            As for a result of `estimation.identify`.
        """
        from estimation.figure_style import figure_style
        from estimation.figures import Result, estimates_figure, misfit_remark

        found = self.analysis.result
        k, b = (
            Interval(getattr(found, part), *found.interval(part))
            if found.determines(part)
            else None
            for part in ("k", "b")
        )
        remark = misfit_remark({name: one.misfit for name, one in self.summaries().items()})
        x, v, *_ = self.regression
        with figure_style(width):
            return estimates_figure(
                title, self.t, x, v, self.estimates, truth, Result(k, b, found.kinds["k"]), remark
            )

    def summary(self, cost: bool = False) -> dict[str, Any]:
        """Return all results as a dictionary, which `teleop estimate --json` prints as JSON."""
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
            "memory_s": 0.5 / rate if (rate := self.preset.forgetting_rate) else math.inf,
            "left_out": self.averaged.left_out,
            "expected_intervals": self.online.expected._asdict(),
            "estimates": estimates,
            "least_squares": self.least_squares.summary(self.preset.model.further),
        }

    def summaries(self) -> dict[str, EstimatorSummary]:
        """Return averages, errors and last estimates of each estimator, by its name."""
        return self.online.summaries

    @cached_property
    def models(self) -> list[BatchFit]:
        """The models that are fitted to all samples together, the best model first.

        Displacement and force in the models are relative to the datum (the point that is treated as
        zero).
        """
        return self.analysis.models(self.datum.x, self.datum.f)

    @cached_property
    def best_model(self) -> BatchFit | None:
        """The best of `models` whose parameters are all identifiable; None without k and b."""
        if not self.analysis.result.identifiable:
            return None
        return next((fit for fit in self.models if fit.identifiable), None)

    def batch_summary(self) -> dict[str, Any]:
        """Return the results of the batch evaluation as a dictionary for JSON.

        It contains k and b, the fitted models, the phases of the motion, and remarks.
        """
        result = self.analysis.result
        reasons, hints = list(result.reasons), list(result.hints)
        local = self.analysis.local
        for part, half in self.online.expected._asdict().items():
            # the expected intervals take the misfit of the Kelvin-Voigt model for noise
            suits = local is None or local.is_linear
            known = result.resolves(part) or (part == "k" and reasons)
            if half > LARGEST_EXPECTED and suits and not known:
                reasons.append(
                    f"motion and noise do not determine {part}: its expected interval is "
                    f"{half_width_text(half)}, and a larger or faster motion makes it narrower"
                )
        if self.in_sections:
            reasons.append(
                f"the record is long: result and models are those of {self.batch_samples} of "
                f"{self.samples} samples, in evenly spaced sections"
            )
        if self.filter_note:
            reasons.append(self.filter_note.text)
            hints.append(self.filter_note.hint)
        if self.kept_force_variance < LEAST_KEPT_VARIANCE:
            reasons.append(
                f"conditioning at {self.bandwidth:.3g} Hz keeps {self.kept_force_variance:.0%} of "
                "the force variance: the online estimates describe that part only"
            )
        return {
            "result": {**result.summary(), "reasons": reasons, "hints": hints},
            "best_model": self.best_model and self.best_model.name,
            "models": [fit.summary() for fit in self.models],
            **self.analysis.summary(),
            "kept_force_variance": self.kept_force_variance,
        }
