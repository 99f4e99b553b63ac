"""Evaluate a recording, or any file with position and force, with estimators and batch models."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from estimation import (
    Bank,
    Estimates,
    Excitation,
    Fit,
    Misfit,
    Preset,
    Regression,
    least_squares,
    paper_preset,
    scaled_preset,
)
from estimation.batch_models import BatchFit
from estimation.compiled import Floats
from estimation.conditioner_choice import make_conditioner
from estimation.conditioning import BANDWIDTH
from estimation.estimate_columns import estimate_arrays, estimate_columns, misfit_columns
from estimation.excitation import dominant_frequency
from estimation.least_squares import no_fit
from estimation.model import KELVIN_VOIGT
from estimation.presentation import Presented
from estimation.registry import PAPER
from estimation.summary import EstimatorSummary, summarise
from teleop.errors import InputError, as_input_error
from teleop.evaluation.analysis import Analysis, analyse
from teleop.evaluation.averaged_part import WHOLE, AveragedPart
from teleop.evaluation.conditioned import FEWEST, conditioned, within
from teleop.evaluation.contact_bank import ContactBank, contact_at
from teleop.evaluation.datum import Datum, find_datum, moving_part
from teleop.evaluation.estimate_settings import EstimateSettings
from teleop.evaluation.force_filter import without_filter_delay
from teleop.evaluation.in_blocks import excitation_of, misfit_of
from teleop.evaluation.kept_variance import kept_variance
from teleop.evaluation.model_comparison import compare
from teleop.evaluation.model_comparison import cost as sample_cost
from teleop.evaluation.sampling_gaps import closed_up
from teleop.evaluation.signals import Signals
from teleop.evaluation.smallest_step import smallest_step

FEWEST_KEPT = 0.9
"""A message is reported if the conditioning keeps less than this fraction of the force variance."""
LEAST_EXCITATION = 0.01
"""Excitation below which a remark on b of the online estimators is reported.

Below this excitation, the standard deviation of b omega is more than ten times that of k. If k is
known to 10 %, a loss tangent b omega / k below one can then not be measured.
"""


@dataclass(frozen=True, repr=False)
class Evaluation(Presented):
    """Online estimates and batch evaluation of one recording. Arrays have shape (n,)."""

    t: Floats
    regression: Regression
    """The conditioned samples, which are the input of the estimators."""
    estimates: dict[str, Estimates]
    bank: Bank
    least_squares: Fit
    """Least-squares fit to all conditioned samples; NaN without contact."""
    datum: Datum
    preset: Preset
    bandwidth: float
    rate: float
    """Sampling rate: inverse of the median sample period [Hz]."""
    jitter: float
    """Largest deviation of a sample period from the median, as a fraction of the median."""
    samples: int
    """Number of samples in the recording, including those at rest."""
    excitation: Floats
    """Excitation measure at the dominant frequency of the motion, after each sample."""
    misfit: dict[str, Floats]
    """Misfit of each estimator (`estimation.misfit`)."""
    analysis: Analysis
    """The batch evaluation."""
    kept_force_variance: float
    """Fraction of the variance of the force that the conditioning keeps, from 0 to 1."""
    filter_note: str
    """Text that states how the delay of the force filter was compensated, or why it was not; empty
    if the file states no filter."""
    gaps: tuple[tuple[float, float], ...] = ()
    """Time of the last sample before each gap, and of the first sample after the gap [s]."""
    averaged: AveragedPart = WHOLE
    """The part of the record over which the online estimates are averaged."""

    def summary(self, cost: bool = False) -> dict[str, Any]:
        """Return the results with the keys of the output of `teleop estimate --json`.

        Parameters
        ----------
        cost
            Whether to measure the computing time of each estimator per sample. The measured time is
            different in each call.
        """
        estimates = {name: one._asdict() for name, one in self.summaries().items()}
        excitation = self.excitation[self.averaged.contains(self.t)]
        if not set(estimates) <= set(PAPER):
            x, v, f, *_ = self.regression
            for fit, modelled in ((least_squares(x, v, f), False), (self.least_squares, True)):
                group = {
                    name: series
                    for name, series in self.estimates.items()
                    if bool(self.bank[name].model.further) is modelled
                }
                rows = compare(self.regression, self.bank, group, fit.b, fit.k)
                for name, row in rows.items():
                    estimates[name] |= row._asdict()
        if cost:
            for name in estimates:
                estimates[name]["cost_us"] = sample_cost(self.bank[name], self.regression) * 1e6
        return {
            **self.batch_summary(),
            "samples": self.samples,
            "samples_used": len(self.t),
            "rate_hz": self.rate,
            "jitter": self.jitter,
            "longest_gap_s": float(np.max(self.regression.dt)),
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
                "mean": float(np.mean(excitation)) if len(excitation) else math.nan,
                "last": float(excitation[-1]) if len(excitation) else math.nan,
            },
            "estimates": estimates,
            "least_squares": self.least_squares.summary(self.preset.model.further),
        }

    def summaries(self) -> dict[str, EstimatorSummary]:
        """Return a summary of the estimates of each estimator, by the name of the estimator."""
        part = self.averaged.contains(self.t)
        t, regression = self.t[part], self.regression.part(part)
        return {
            name: summarise(
                t, regression, series.part(part), self.bank[name], self.misfit[name][part]
            )
            for name, series in self.estimates.items()
        }

    @cached_property
    def models(self) -> list[BatchFit]:
        """The models of the batch evaluation, relative to the datum, the best first."""
        return self.analysis.models(self.datum.x, self.datum.f)

    def batch_summary(self) -> dict[str, Any]:
        """Return the result, the models and the phases as a dictionary for JSON."""
        result = self.analysis.result
        reasons = list(result.reasons)
        excitation = float(np.percentile(self.excitation, 95))
        if excitation < LEAST_EXCITATION:
            reasons.append(
                f"the excitation of the online estimators is {excitation:.1g} at most: below "
                f"{LEAST_EXCITATION:g} they cannot separate b from k"
            )
        if self.filter_note:
            reasons.append(self.filter_note)
        if self.kept_force_variance < FEWEST_KEPT:
            reasons.append(
                f"conditioning at {self.bandwidth:.3g} Hz keeps {self.kept_force_variance:.0%} of "
                "the force variance: the online estimates describe that part only"
            )
        identified = [fit.name for fit in self.models if fit.identifiable]
        best = identified[0] if identified and result.identifiable else None
        return {
            "result": {**result.summary(), "reasons": reasons},
            "best_model": best,
            "models": [fit.summary() for fit in self.models],
            **self.analysis.summary(),
            "kept_force_variance": self.kept_force_variance,
        }

    def columns(self) -> tuple[dict[str, Floats], dict[str, str]]:
        """Return signals and estimates as columns of shape (n,), and the unit of each column."""
        x, v, f, *_ = self.regression
        columns = {"Time": self.t, "Displacement": x, "Velocity": v, "Force": f}
        units = {"Time": "s", "Displacement": "m", "Velocity": "m/s", "Force": "N"}
        columns["Excitation"], units["Excitation"] = self.excitation, "-"
        for column, values in zip(
            estimate_columns(self.bank), estimate_arrays(self.estimates), strict=True
        ):
            columns[column.name] = np.asarray(values, dtype=np.float64)
            units[column.name] = column.unit
        for column, values in zip(misfit_columns(self.bank), self.misfit.values(), strict=True):
            columns[column.name], units[column.name] = values, column.unit
        return columns, units


def evaluate(signals: Signals, settings: EstimateSettings) -> Evaluation:
    """Subtract the datum, condition the signals, and run the estimators over the moving part.

    The filters restart after each gap. Samples are omitted until the filters have settled. The
    estimators receive the duration of the gap as the sample period, so that the weight of the
    samples before the gap depends on their true age.

    Raises
    ------
    InputError
        A setting is out of its range, nothing moves, or too few samples remain between gaps.
    """
    lag, note = settings.force_lag, ""
    if lag is None:
        lag, (signals, note) = 0.0, without_filter_delay(signals)
    if len(signals.t) < FEWEST:
        raise InputError(
            f"the estimators received only {len(signals.t)} samples: expected at least {FEWEST}"
        )
    if np.ptp(signals.f) == 0.0:
        raise InputError("nothing to estimate from: the force is the same in every sample")
    motion = slice(None) if settings.whole else moving_part(signals.x)
    if len(signals.dt[motion]) < FEWEST:
        raise InputError(f"only {len(signals.dt[motion])} samples move: expected at least {FEWEST}")
    with as_input_error():
        analysis = analyse(within(signals, settings.averaged), lag)
    datum = find_datum(signals, settings.datum, analysis.phases)
    band = analysis.record.band
    frequency = band.centre
    if band.coherence == 0.0:
        frequency = dominant_frequency(
            signals.x[motion], closed_up(signals.dt, signals.gaps)[motion]
        )
    bandwidth = settings.bandwidth
    if bandwidth is None:
        highest = band.high if band.coherence > 0.0 else frequency
        bandwidth = 10.0 * highest if settings.preset == "scaled" else BANDWIDTH
        bandwidth = min(bandwidth, 0.5 / float(np.median(signals.dt)))
    count = settings.resolution or smallest_step(signals.x)
    given = settings.preset if isinstance(settings.preset, Preset) else None
    model = settings.model or (given.model if given else KELVIN_VOIGT)
    with as_input_error():
        conditioner = make_conditioner(settings.conditioning, bandwidth, count, lag, model)
    t, regression, used, apart = conditioned(conditioner, signals, datum, motion)
    x, v, f, dt, _ = regression
    with as_input_error():
        if given:
            preset = given
        else:
            paper = settings.preset == "paper"
            preset = paper_preset(settings.cube) if paper else scaled_preset(x, v, f, dt)
            preset = replace(preset, correlation=conditioner.correlation(float(np.median(dt))))
        preset = replace(preset, model=model, estimators=settings.estimators or preset.estimators)
        bank = preset.bank()
    if given is None:
        bank = ContactBank(bank, contact_at(analysis, t))
    estimates = bank.run(*regression)
    misfit = Misfit(bank) if given else Misfit(bank, 1.0 / frequency)
    measure = Excitation(frequency, resolution=10.0 * count)
    period = float(np.median(dt))
    first, *_, last = np.arange(len(signals.t))[motion]
    gaps = [i for i in signals.gaps if first < i <= last]
    return Evaluation(
        t=t,
        regression=regression,
        estimates=estimates,
        bank=bank,
        least_squares=least_squares(x, v, f, regression.further)
        if analysis.has_contact
        else no_fit(len(x), len(model.further)),
        datum=datum,
        preset=preset,
        bandwidth=bandwidth,
        rate=1.0 / period,
        jitter=float(np.max(np.abs(np.delete(dt, apart) - period))) / period,
        samples=len(signals.t),
        excitation=excitation_of(measure, regression),
        misfit=misfit_of(misfit, regression, estimates, bank),
        analysis=analysis,
        filter_note=note,
        kept_force_variance=kept_variance(signals.f, regression.f, used, bandwidth * period),
        gaps=tuple((float(signals.t[i - 1]), float(signals.t[i])) for i in gaps),
        averaged=settings.averaged,
    )
