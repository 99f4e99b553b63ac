"""Compute k and b of a sine from its harmonic fit (`harmonic_fit`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from estimation.estimator import LEVEL_95
from estimation.stiffening import Interval
from estimation.transmission import TransmissionCalibration
from teleop.evaluation.batch.constancy import change_over_cycles, drift_of_lag
from teleop.evaluation.batch.harmonic_fit import HarmonicFit
from teleop.evaluation.batch.reasons import (
    DAMPING_NOT_RESOLVED,
    negative_damping,
    unknown_form,
)
from teleop.evaluation.batch.stiffness_result import (
    StiffnessResult,
    stiffness_at_tip,
    texts_and_hints,
)
from teleop.evaluation.batch.thresholds import (
    LARGEST_PHASE_DRIFT,
    SMALL_BASELINE,
    STEEPEST_LOSS,
    WIDEST_INTERVAL,
)
from teleop.evaluation.reason import Reason


def harmonic_result(
    fit: HarmonicFit,
    transmission: TransmissionCalibration,
    faults: Sequence[Reason] = (),
) -> StiffnessResult | None:
    """Return k and b of a harmonic fit; None if a fault of the record is more likely."""
    k, half_k, loss, half_loss = fit.stiffness
    if k <= 0.0 or loss < -STEEPEST_LOSS * k:
        return None
    omega = 2.0 * math.pi * fit.frequency
    amplitude = fit.position.amplitude
    position_error = math.hypot(fit.position.noise, fit.position.step / math.sqrt(12.0))
    half_k = math.hypot(half_k, transmission.stiffness_error(k, amplitude, omega, position_error))
    per_speed = 4.0 / (math.pi * omega * amplitude)
    b = loss / omega
    half_b = math.hypot(half_loss / omega, transmission.damping_error(k, per_speed, omega))
    change, drift = change_over_cycles(fit.cycles), drift_of_lag(fit.cycles)
    by_rounding = 2.0 * LEVEL_95 * fit.rounding_error * k
    if change and abs(change.k[1] - change.k[0]) < by_rounding:
        change = None  # in a drift, the rounding error of the fundamental changes
    if half_k > WIDEST_INTERVAL * k or (drift and drift.phase > LARGEST_PHASE_DRIFT):
        return None
    found = [*faults, *unknown_form(transmission, omega)]
    if fit.line and not change:  # a change of the stiffness also gives lines
        found.append(Reason(fit.line.text))
    if change:
        half_k = max(half_k, *(abs(k - one) for one in change.k))
        found.append(Reason(change.text))
    size = 2.0 * fit.force.amplitude
    if fit.drift > SMALL_BASELINE * size + 0.5 * fit.force.step:
        found.append(
            Reason(
                f"a baseline is removed ({fit.drift:.3g} N peak to peak): drift, relaxation, or a "
                "transient at the start"
            )
        )
    unknown = None
    if drift:
        unknown = Reason(f"{drift.text}: damping is not determined")
    elif b + half_b < 0.0:
        unknown = negative_damping(b, transmission, -b / k, 1.0 / fit.frequency)
    unusable = unknown
    if unknown:
        found.append(unknown)
    elif half_b > abs(b):
        unusable = Reason(DAMPING_NOT_RESOLVED)
        found.append(unusable)
    interval = Interval(k, k - half_k, k + half_k)
    k_tip, too_compliant = stiffness_at_tip(interval, transmission)
    found += too_compliant
    reasons, hints = texts_and_hints(found)
    return StiffnessResult(
        k=k,
        k_low=interval.low,
        k_high=interval.high,
        b=None if unknown else b,
        b_low=None if unknown else b - half_b,
        b_high=None if unknown else b + half_b,
        b_reason=unusable.text if unusable else "",
        identifiable=True,
        reasons=reasons,
        hints=hints,
        force=float(fit.force.middle.mean()),
        # in loading, the force is in its middle before the position is
        depth=amplitude * (1.0 - loss / math.hypot(k, loss)),
        damping_at_hz=fit.frequency,
        k_tip=k_tip,
        storage_at_hz=fit.frequency,
        inertia_at_hz=fit.frequency,
    )
