"""Evaluate all samples of a record together: phases of the motion, fitted models, k and b."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from estimation.baseline import baseline, without_baseline
from estimation.batch_models import BatchData, BatchFit, compare_models
from estimation.batch_models.hunt_crossley import fit_hunt_crossley
from estimation.batch_models.prony import Relaxation, fit_prony
from estimation.quantities import STIFFNESS
from estimation.robust_error import robust_fit
from estimation.smoothing import CORNER
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.evaluation.batch.candidate import MASS
from teleop.evaluation.batch.complex_stiffness import ComplexStiffness, complex_stiffness
from teleop.evaluation.batch.constancy import cycles_of
from teleop.evaluation.batch.contact_phases import Phase, Phases, find_phases
from teleop.evaluation.batch.force_drift import ForceDrift, find_drift
from teleop.evaluation.batch.harmonic_fit import HarmonicFit, harmonic_fit
from teleop.evaluation.batch.harmonic_result import harmonic_result
from teleop.evaluation.batch.interference import interference
from teleop.evaluation.batch.local_stiffness import LocalStiffness, local_stiffness
from teleop.evaluation.batch.lost_motion import find_lost_motion
from teleop.evaluation.batch.moving_contact import find_moving_contact
from teleop.evaluation.batch.reasons import reasons_before_fit
from teleop.evaluation.batch.regression_rows import RegressionRows, sharp_position
from teleop.evaluation.batch.sampling_checks import without_sampling_faults
from teleop.evaluation.batch.smoothed_record import SmoothedRecord, resample, smoothed_record
from teleop.evaluation.batch.stiffness_result import (
    StiffnessResult,
    stiffness_result,
    with_alternative,
    with_lost_motion,
    with_moving_contact,
    with_possible_lost_motion,
    without_result,
)
from teleop.evaluation.batch.strokes import cycle_frequency, least_stroke, turning_points
from teleop.evaluation.batch.thresholds import (
    BETTER_BIC,
    BETTER_RESIDUAL,
    CONTRADICTION_NOISE,
    FEWEST_FIT_SAMPLES,
    FEWEST_STROKES,
    LEAST_STROKE_NOISE,
    WIDEST_KERNEL,
)
from teleop.evaluation.reading.signals import Signals
from teleop.evaluation.reason import Reason


class MotionSummary(NamedTuple):
    """Frequency, amplitude, travel and shape of the motion in a record.

    The values describe the position. A stroke is the motion from one reversal to the next.
    """

    frequency_hz: float
    """Mean frequency of the cycles [Hz]; NaN if there are fewer than `FEWEST_STROKES` strokes."""
    amplitude_m: float
    """Half of the median travel of the strokes [m]; NaN if `frequency_hz` is NaN."""
    travel_m: float
    """Largest minus smallest position [m]."""
    strokes: int
    """Number of whole strokes; 0 if their median travel is not clearly larger than the noise."""
    fundamental_share: float
    """Share of the fundamental frequency in the power of the velocity: 1 for a sine, NaN for a
    motion with too few cycles
    (`teleop.evaluation.batch.smoothed_record.SmoothedRecord.fundamental_share`)."""


def motion_of(record: SmoothedRecord) -> MotionSummary:
    """Return frequency, amplitude, travel and shape of the motion in a record.

    They are computed from the smoothed position. Smoothing makes the amplitude smaller. This effect
    is compensated (`sharp_position`).
    """
    x = sharp_position(record)
    travel = float(np.ptp(x))
    palpation = without_baseline(x, record.order)
    turns = turning_points(palpation, least_stroke(palpation))[1:-1]
    strokes = np.abs(np.diff(palpation[turns]))
    frequency = cycle_frequency(record.palpation, record.period)
    found = len(strokes)
    if not found or float(np.median(strokes)) < LEAST_STROKE_NOISE * record.x_noise:
        found = 0
    if frequency is None or found < FEWEST_STROKES:
        return MotionSummary(math.nan, math.nan, travel, found, record.fundamental_share)
    half = 0.5 * float(np.median(strokes))
    return MotionSummary(frequency, half, travel, found, record.fundamental_share)


LEAST_UNKNOWN_SHARE, KNOWN_SHARE_ERROR = 0.5, 0.25
"""Error of the share of a pure delay in a lag with which its form is not known, and that of a form
that the record shows. Three shares are tried: 0, 0.5 and 1."""
WIDER_BAND = 1.6
"""Ratio of a second smoothing bandwidth to the first. The change of k between the two bandwidths
widens the interval of k."""


@dataclass(frozen=True)
class Analysis:
    """The batch evaluation of a record: all samples are evaluated together."""

    record: SmoothedRecord
    """The record, resampled to a constant period and smoothed."""
    phases: Phases
    """Free motion, loading, hold and unloading, and the contact point."""
    local: LocalStiffness | None
    """Stiffness and damping of the fitted models; None without contact, or with too few samples."""
    result: StiffnessResult
    """k and b with 95 % intervals, or the reasons why they are not identifiable."""
    transmission: TransmissionCalibration
    """Calibrated transmission for which the record is corrected."""
    harmonic: HarmonicFit | None = None
    """Fit of a sine with few samples per cycle or coarse rounding; None for other records."""
    drift: ForceDrift | None = None
    """Drift of the force out of contact, which is removed from the record; None without one."""

    @property
    def has_contact(self) -> bool:
        """Whether the force follows the displacement. If not, there is no contact in the record."""
        return self.record.band.coherence > 0.0

    @cached_property
    def data(self) -> BatchData | None:
        """Samples to which the models are fitted; None if too few samples are in contact."""
        record, phases = self.record, self.phases
        rows = RegressionRows(record, phases)
        if len(rows.index) < FEWEST_FIT_SAMPLES:
            return None
        f, slow, regressors = record.f, np.zeros(len(record.f)), None
        if rows.order and self.local:
            seconds = float(record.clock[-1])
            coefficients = self.local.best.theta[: rows.v_column]
            slow = baseline(record.clock, 0.0, seconds, coefficients)
            slow -= slow[rows.index].mean()
            regressors = rows.basis[:, 1:] - rows.basis[:, 1:].mean(axis=0)
        return BatchData(
            t=record.t,
            x=record.x,
            raw_x=record.raw_x,
            v=record.v,
            f=f - slow,
            raw_f=record.raw_f - slow,
            rows=rows.index,
            inside=rows.fine,
            starts=record.starts,
            width=record.width,
            contact=phases.contact_point.value if phases.contact_point else None,
            baseline=regressors,
            cycles=rows.cycles,
        )

    def models(self, x: float, f: float) -> list[BatchFit]:
        """Return the models that are fitted to the record, the best model first.

        The datum is the point at which displacement and force are zero. The models use displacement
        and force relative to the datum. The result is empty if there is no contact, or if there are
        too few samples in contact.
        """
        data = self.data
        if data is None or not self.has_contact:
            return []
        contact = None if data.contact is None else data.contact - x
        unloaded = (self.phases.free_force or 0.0) - f
        return compare_models(
            data._replace(
                x=data.x - x,
                raw_x=data.raw_x - x,
                f=data.f - f,
                raw_f=data.raw_f - f,
                contact=contact,
                unloaded=unloaded,
            )
        )

    def summary(self) -> dict[str, Any]:
        """Return motion, phases, cycles, contact point and complex stiffness, as a dictionary."""
        point = self.phases.contact_point
        return {
            "motion": motion_of(self.record)._asdict(),
            "phases": self.phase_rows,
            "cycles": self.cycles(),
            "cycles_summary": cycles_of(self.record, self.phases).summary(),
            "contact_point": point
            and dict(zip(("position_m", "low_m", "high_m"), point, strict=True)),
            "complex_stiffness": self.complex_stiffness(),
        }

    @cached_property
    def phase_rows(self) -> list[dict[str, Any]]:
        """The phases of the motion in the order of time, as dictionaries for JSON (`phase_row`)."""
        return [self.phase_row(phase) for phase in self.phases.phases]

    def phase_row(self, phase: Phase) -> dict[str, Any]:
        """Return one phase of the motion as a dictionary for JSON.

        The dictionary contains the times, the travel and the forces of the phase. For loading and
        unloading, it also contains k, the slope of the force against the position [N/m]. For a
        hold, it also contains the relaxation of the force (`relaxation_row`).
        """
        record = self.record
        part = slice(phase.start, phase.end)
        t, x, f = record.t[part], record.x[part], record.f[part]
        row: dict[str, Any] = {
            "phase": phase.name,
            "from_s": float(t[0]),
            "to_s": float(t[-1]),
            "travel_m": float(np.ptp(x)),
            "force_from_n": float(f[0]),
            "force_to_n": float(f[-1]),
            "k": None,
            "k_std": None,
        }
        every = slice(None, None, record.stride)
        if phase.name in ("loading", "unloading") and len(t[every]) > 4 and np.ptp(x) > 0.0:
            fit = robust_fit(np.column_stack([np.ones(len(t[every])), x[every]]), f[every])
            row["k"] = float(fit.theta[1])
            row["k_std"] = fit.deviation(np.array([0.0, 1.0]))
        if phase.name == "hold" and len(t[every]) >= FEWEST_FIT_SAMPLES:
            found = fit_prony(t[every] - t[0], f[every])
            row["relaxation"] = relaxation_row(found) if found else None
        return row

    def cycles(self) -> list[dict[str, Any]]:
        """Return k and b of each cycle in contact, as dictionaries for JSON.

        A cycle lasts from the start of one loading to the start of the next loading.
        """
        data = self.data
        if data is None:
            return []
        begins = [phase.start for phase in self.phases.phases if phase.name == "loading"]
        usable = self.phases.usable
        found = []
        for start, end in pairwise(begins):
            part = start + np.flatnonzero(usable[start:end])[:: max(1, self.record.stride // 2)]
            if len(part) < 8:
                continue
            columns = np.column_stack([np.ones(len(part)), data.v[part], data.x[part]])
            theta = robust_fit(columns, data.f[part]).theta
            found.append(
                {
                    "from_s": float(data.t[start]),
                    "to_s": float(data.t[end - 1]),
                    "k": float(theta[2]),
                    "b": float(theta[1]),
                }
            )
        return found

    def complex_stiffness(self) -> dict[str, float] | None:
        """Return the complex stiffness k' + i k'' at the frequency of the palpation.

        The dictionary contains the storage stiffness k' [N/m], the loss stiffness k'' [N/m] and
        tan delta = k'' / k'. For each of them, it also contains the half width of the 95 %
        interval. The motion must be a sine in contact throughout. On a linear body they are then k
        and b omega of the result. On a nonlinear body they are computed from the fundamentals of
        force and position (`complex_stiffness`), and differ from the tangent stiffness k. The
        result is None in all other cases: another motion, k or b is not identifiable, or the best
        model contains relaxation (a decay of the force at constant position), so that b describes
        only a part of the loss of energy.
        """
        result, record = self.result, self.record
        steady = record.sinusoidal and self.phases.free_force is None and not result.times
        if self.harmonic:
            return complex_row(self.harmonic.stiffness, self.harmonic.frequency)
        if not steady or result.k is None or result.b is None or self.local is None:
            return None
        assert result.k_low is not None
        assert result.b_low is not None
        omega = 2.0 * np.pi * record.frequency
        if self.local.is_linear:
            found = ComplexStiffness(
                result.k,
                result.k - result.k_low,
                result.b * omega,
                (result.b - result.b_low) * omega,
            )
        else:
            lock_in = complex_stiffness(record, self.local.curved)
            if lock_in is None:
                return None
            found = lock_in
            if result.damping_at_hz is not None:
                # the interval of b also contains the errors of the transmission
                found = lock_in._replace(
                    loss=result.b * omega, loss_half=(result.b - result.b_low) * omega
                )
        return complex_row(found, record.frequency)


def complex_row(found: ComplexStiffness, frequency: float) -> dict[str, float]:
    """Return a complex stiffness at a frequency [Hz] as a dictionary for JSON."""
    storage, storage_half, loss, loss_half = found
    return {
        "frequency_hz": frequency,
        "storage_n_per_m": storage,
        "storage_interval_n_per_m": storage_half,
        "loss_n_per_m": loss,
        "loss_interval_n_per_m": loss_half,
        "tan_delta": loss / storage,
        "tan_delta_interval": float(
            np.hypot(loss_half / storage, loss * storage_half / storage**2)
        ),
    }


def relaxation_row(found: Relaxation) -> dict[str, Any]:
    """Return a Prony series, which was fitted to the force in a hold, as a dictionary for JSON."""
    return {name: one._asdict() for name, one in found.parameters.items()} | {"rms": found.rms}


def analyse(signals: Signals, transmission: TransmissionCalibration = RIGID) -> Analysis:
    """Evaluate all samples of a record together, without online estimators.

    The lost motion of `transmission` has been removed from the position before. If it is not known,
    and the record shows lost motion, the evaluation is repeated with the position behind it.
    """
    signals, faults = without_sampling_faults(signals)
    drift = find_drift(smoothed_record(resample(signals, transmission)))
    if drift is not None:
        signals, faults = drift.removed(signals), (*faults, Reason(drift.text))
    return replace(analyse_checked(signals, transmission, faults), drift=drift)


def analyse_checked(
    signals: Signals, transmission: TransmissionCalibration, faults: Sequence[Reason]
) -> Analysis:
    """Evaluate a record without faults of the logger and without drift of the force.

    `faults` are the remarks on those that were removed.
    """
    if harmonic := coarse_sine(signals, transmission, faults):
        return harmonic
    analysis = fitted(signals, transmission, faults)
    stated = transmission.force_lag and not transmission.force_lag_error
    if stated and transmission.delay_share_error >= LEAST_UNKNOWN_SHARE:
        analysis = with_form_of_lag(analysis, signals, faults)
        transmission = analysis.transmission
    if analysis.local is None:
        return analysis
    moving = find_moving_contact(analysis.record, analysis.phases, analysis.local.best)
    if moving is not None and moving.is_certain:
        signals, faults = moving.removed(signals), (*faults, Reason(moving.text))
        analysis = fitted(signals, transmission, faults)
        analysis = replace(analysis, result=with_moving_contact(analysis.result))
    found = None
    if analysis.local is not None and not transmission.lost_motion:
        found = find_lost_motion(analysis.record, analysis.phases, analysis.local.best)
    if found is None:
        if moving is None or moving.is_certain:
            return analysis
        other = fitted(moving.removed(signals), transmission, faults).result
        result = with_alternative(analysis.result, other, Reason(moving.text))
        return replace(analysis, result=result)
    assert analysis.local is not None
    tip = signals._replace(x=found.tip(signals.x), measured_step=signals.step)
    known = replace(
        transmission,
        lost_motion=found.half_width,
        lost_motion_error=found.error,
        lag_lost_motion_correlation=0.0,
    )
    # the shape of the hysteresis is not known, and the rest of it is not friction in the specimen
    corrected = fitted(tip, known, faults, friction=False)
    line = interference(corrected.record)
    if reasons_before_fit(corrected.record, corrected.phases) or (line and line.hides_stiffness):
        return analysis  # another fault, which lost motion does not explain
    result = with_lost_motion(corrected.result, analysis.local, found)
    if not found.is_confirmed:
        return replace(analysis, result=with_possible_lost_motion(analysis.result, result, found))
    return replace(corrected, result=result)


def with_form_of_lag(analysis: Analysis, signals: Signals, faults: Sequence[Reason]) -> Analysis:
    """Return the evaluation with the form of a stated lag that describes the force clearly better.

    A lag of a wrong form leaves a force that looks like that of a relaxation, or of a mass. Without
    such a force in the best model, and if no form is clearly better, `analysis` is returned.
    """
    if not (analysis.local and (analysis.local.best.times or analysis.local.best.part(MASS))):
        return analysis
    best = analysis
    for share in (0.0, 1.0):
        known = replace(
            analysis.transmission, delay_share=share, delay_share_error=KNOWN_SHARE_ERROR
        )
        other = fitted(signals, known, faults)
        if other.local is None or best.local is None or other.local.samples != best.local.samples:
            continue
        if other.local.best.bic < best.local.best.bic - BETTER_BIC:
            best = other
    return best


def coarse_sine(
    signals: Signals, transmission: TransmissionCalibration, faults: Sequence[Reason]
) -> Analysis | None:
    """Return the evaluation of a sine with few samples per cycle or coarse rounding.

    The result is None for other records, and for those with a reason against such a result.
    """
    fit = harmonic_fit(signals, transmission)
    result = fit and harmonic_result(fit, transmission, faults)
    if not result:
        return None
    record = smoothed_record(resample(signals, transmission))
    return Analysis(record, find_phases(record), None, result, transmission, fit)


def fitted(
    signals: Signals,
    transmission: TransmissionCalibration,
    faults: Sequence[Reason],
    friction: bool = True,
) -> Analysis:
    """Fit the models to a record, and return k and b.

    `faults` are the remarks on its samples. `friction` states whether the specimen may have it.
    """
    resampled = resample(signals, transmission)
    record = smoothed_record(resampled)
    phases = find_phases(record, with_point=False)
    durations = [
        (phase.end - phase.start) * record.period
        for phase in phases.phases
        if phase.name == "loading"
    ]
    widest = WIDEST_KERNEL * float(np.median(durations)) if durations else record.width
    bandwidth = CORNER / record.width
    if widest < 0.8 * record.width:
        bandwidth = CORNER / max(widest, resampled.period)
        record = smoothed_record(resampled, bandwidth)
    phases = find_phases(record)
    local = other = None
    if record.band.coherence > 0.0:
        local = local_stiffness(record, phases, friction=friction)
    if local is not None:
        finer = smoothed_record(resampled, WIDER_BAND * bandwidth)
        at_finer = find_phases(finer, with_point=False)
        at_finer = replace(at_finer, contact_point=phases.contact_point)
        other = local_stiffness(finer, at_finer, friction=friction)
    result = stiffness_result(record, phases, local, other, transmission, faults)
    found = Analysis(record, phases, local, result, transmission)
    if contrary := contradiction(found):
        return replace(found, result=without_result([contrary, *faults]))
    return found


def contradiction(found: Analysis) -> Reason | None:
    """Return the reason why a batch model contradicts k; None if no model does.

    The Hunt-Crossley model contradicts k if it describes the force clearly better than the best
    candidate, and if its tangent at the force of k is outside of the interval of k.
    """
    local, result, record = found.local, found.result, found.record
    if local is None or result.k is None or result.force is None:
        return None
    noise = math.hypot(record.f_noise, result.k * record.x_noise) * record.noise_gain
    data = found.data
    if data is None or local.best.rms < CONTRADICTION_NOISE * noise:
        return None
    unloaded = found.phases.free_force or 0.0
    fit = fit_hunt_crossley(data._replace(unloaded=unloaded))
    if not fit.identifiable:
        return None
    n = len(data.rows)
    parameters = len(fit.parameters)
    rms = math.exp((fit.bic - parameters * math.log(n)) / (2.0 * n))
    slow = 0 if data.baseline is None else data.baseline.shape[1]
    excess = local.best.parameters - slow - parameters  # the baseline was removed before
    better = 2.0 * n * math.log(local.best.rms / max(rms, 1e-300)) + excess * math.log(n)
    if rms * BETTER_RESIDUAL > local.best.rms or better < BETTER_BIC:
        return None
    size, exponent = (fit.parameters[name].value for name in ("K", "n"))
    force = local.best.force - unloaded
    if force <= 0.0 or size <= 0.0:
        return None
    tangent = exponent * force / (force / size) ** (1.0 / exponent)
    low, high = result.interval("k")
    if low <= tangent <= high:
        return None
    return Reason(
        f"two models give different stiffness: the Hunt-Crossley model describes the force better "
        f"(residual {rms:.2g} N, and {local.best.rms:.2g} N), and its tangent at {force:.3g} N is "
        f"{STIFFNESS.text(tangent, '.4g')}, not {STIFFNESS.text(result.k, '.4g')}"
    )
