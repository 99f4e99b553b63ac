"""Compute the result for publication: stiffness and damping with 95 % intervals.

k is the tangent stiffness at half of the force range, in loading (`local_stiffness`). k depends
neither on the zero of position and force nor on the length of the record. The secant stiffness (the
force divided by the depth) is reported in addition to k. The secant stiffness depends on the zero
and on the length of the record. The result also states how much the secant stiffness would change
if the zero of the position had an error of `DATUM_ERROR`.

The intervals of k and b include four causes of error: the autocorrelation of the residual, the
differences between the fitted models, the change of k and b with the smoothing bandwidth, and the
intervals of the calibrated transmission. If the data are not sufficient for k, both k and b are
None, and `StiffnessResult.reasons` states why.

If the transmission is not calibrated, and the record shows lost motion, k and b are corrected for
it, and their intervals contain a part of the correction (`with_lost_motion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from estimation.estimator import LEVEL_95
from estimation.quantities import DAMPING, STIFFNESS
from estimation.stiffening import Interval
from estimation.transmission import TransmissionCalibration
from teleop.evaluation.batch.candidate import DEPTH_DAMPING, FRICTION, MASS
from teleop.evaluation.batch.complex_stiffness import complex_stiffness
from teleop.evaluation.batch.constancy import change_over_cycles, cycles_of, drift_of_lag
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.depth import elastic_force, surface, zero_of_depth
from teleop.evaluation.batch.extension_texts import NO_PARTS, described
from teleop.evaluation.batch.interference import interference
from teleop.evaluation.batch.kinds import BESIDES_RELAXATION, LOSS, STORAGE, TANGENT
from teleop.evaluation.batch.local_stiffness import LocalStiffness
from teleop.evaluation.batch.lost_motion import LostMotion
from teleop.evaluation.batch.measured_point import Point, gap_at, measured_point
from teleop.evaluation.batch.reasons import (
    DAMPING_NOT_RESOLVED,
    LAG,
    change_of_single_speed,
    change_of_speed_with_depth,
    no_damping,
    reasons_after_fit,
    reasons_before_fit,
    remarks,
    unknown_form,
)
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    CONSTANT_RESIDUAL,
    LARGEST_LAG_EFFECT,
    LARGEST_PHASE_DRIFT,
    LEAST_AMPLITUDE_FOR_B,
    LEAST_AMPLITUDE_FOR_K,
    MOTION_FORM_ERROR,
    NOTABLE_INERTIA,
    NOTABLE_LAG,
    UNCERTAIN_CORRECTION,
    WIDEST_INTERVAL,
)
from teleop.evaluation.reason import Reason

SERIES_DEGREE = 3
"""Degree of the polynomial whose slope is the stiffness behind a calibrated compliance."""
DATUM_ERROR = 1e-4
"""Error of the zero of the position [m]. The change of the secant stiffness that it causes is
reported."""


@dataclass(frozen=True)
class StiffnessResult:
    """Stiffness and damping with 95 % intervals, or the reasons why they are not reported.

    The result also contains the force and the depth at which the stiffness is evaluated.
    """

    k: float | None = None
    """Tangent stiffness [N/m]; None if it is not identifiable."""
    k_low: float | None = None
    """Lower end of the 95 % interval of k [N/m]."""
    k_high: float | None = None
    """Upper end of the 95 % interval of k [N/m]."""
    b: float | None = None
    """Damping [N s/m]; None if it is not determined, which is possible although k is."""
    b_low: float | None = None
    """Lower end of the 95 % interval of b [N s/m]."""
    b_high: float | None = None
    """Upper end of the 95 % interval of b [N s/m]."""
    identifiable: bool = False
    """Whether the data are sufficient for k."""
    reasons: tuple[str, ...] = ()
    """Reasons why k is not identifiable; if k is identifiable, remarks on the result."""
    hints: tuple[str, ...] = ()
    """Sentences that name options and commands of this program with which the user can act on the
    reasons. They are printed in a terminal only."""
    force: float | None = None
    """Force at which the tangent stiffness is evaluated: half of the force range [N]. It is
    relative to the force out of contact if this force is known."""
    depth: float | None = None
    """Depth at `force`, relative to the contact point or to the lowest position in contact [m]."""
    secant: float | None = None
    """Secant stiffness at `force`: force divided by depth [N/m]; None if the force out of contact
    is not known."""
    secant_change: float | None = None
    """Relative change of the secant stiffness that an error of `DATUM_ERROR` in the zero of the
    position causes; None if `secant` is None."""
    times: tuple[Interval, ...] = ()
    """Relaxation time constants of the best model, with their 95 % intervals [s]."""
    depth_error: float = 0.0
    """Half width of the 95 % interval of the contact point [m]; 0 if `depth` is not measured from
    a contact point."""
    depth_from: str = "lowest position"
    """Text that names the position at which `depth` is zero: "contact point", "lowest position" or
    "lowest position in contact"."""
    damping_at_hz: float | None = None
    """Frequency [Hz] at which b is k''/omega, the loss stiffness divided by the angular frequency.
    None if a relaxation of the force may cause part of the loss."""
    k_tip: Interval | None = None
    """Tangent stiffness of the specimen at the tip, with its 95 % interval [N/m]. None if the
    compliance of the transmission is not known. k is that of specimen and transmission in series.
    """
    lost_motion: Interval | None = None
    """Half width of the lost motion that was found in the record, and removed from the position
    [m]; None if none was found, or if the lost motion is calibrated."""
    storage_at_hz: float | None = None
    """Frequency [Hz] at which k is the storage stiffness k'. None if k is the tangent stiffness of
    a nonlinear body, or if the motion is not a sine in contact throughout."""
    inertia_at_hz: float | None = None
    """Frequency [Hz] of a sine, in which a mass beyond the force sensor changes k by the product of
    mass and squared angular frequency, and cannot be identified. None for other motions."""
    b_reason: str = ""
    """Reason why b cannot be used although k can; empty if b can be used."""
    position: float | None = None
    """Position at which the tangent stiffness is evaluated [m]: that of the recording, corrected
    for the lag of the force and the lost motion."""
    parts: dict[str, Any] = field(default_factory=dict)
    """Layers, damping by depth, mass and friction of the best model
    (`teleop.evaluation.batch.extension_texts.described`)."""

    @property
    def kinds(self) -> dict[str, str]:
        """Kind of stiffness and kind of damping of this result, by the symbols "k" and "b".

        Values of different kinds are different physical quantities
        (`teleop.evaluation.batch.kinds`).
        """
        loss = self.damping_at_hz is not None
        stiffness = TANGENT if self.storage_at_hz is None else STORAGE
        return {"k": stiffness, "b": LOSS if loss else BESIDES_RELAXATION}

    @property
    def k_change_per_100g(self) -> float | None:
        """Decrease of k [N/m] by a mass of 100 g that moves between force sensor and specimen.

        The value is None if k is not identifiable, or if the motion is not a sine.
        """
        if self.k is None or self.inertia_at_hz is None:
            return None
        return inertia(self.inertia_at_hz)

    @property
    def b_change_per_ms(self) -> float | None:
        """Decrease of b for each millisecond by which the force lags behind the position [N s/m].

        A lag of the force that is not compensated makes b smaller by the product of k and the lag.
        The value is None if k is not identifiable.
        """
        return None if self.k is None else 1e-3 * self.k

    def interval(self, symbol: str) -> tuple[float, float]:
        """Return the lower and the upper end of the 95 % interval of k [N/m] or b [N s/m].

        The parameter `symbol` is "k" or "b".
        """
        return getattr(self, f"{symbol}_low"), getattr(self, f"{symbol}_high")

    def determines(self, symbol: str) -> bool:
        """Return whether the result contains k or b (`symbol` is "k" or "b").

        For example, a record with constant speed determines k, but not b.
        """
        return getattr(self, symbol) is not None

    def resolves(self, symbol: str) -> bool:
        """Return whether the 95 % interval of k or b (`symbol` is "k" or "b") excludes zero."""
        if not self.determines(symbol):
            return False
        low, high = self.interval(symbol)
        return low > 0.0 or high < 0.0

    def summary(self) -> dict[str, Any]:
        """Return the result as a dictionary that can be written as JSON."""
        document = asdict(self)
        document["reasons"] = list(self.reasons)
        document["k_tip"] = self.k_tip and self.k_tip._asdict()
        del document["lost_motion"]
        document["lost_motion_m"] = self.lost_motion and self.lost_motion._asdict()
        document["hints"] = list(self.hints)
        document |= {**NO_PARTS, **document.pop("parts")}
        document["k_change_per_100g"] = self.k_change_per_100g
        document["b_change_per_ms_of_lag"] = self.b_change_per_ms
        document["tangent"] = {
            "force_n": document.pop("force"),
            "position_m": document.pop("position"),
            "depth_m": document.pop("depth"),
            "depth_error_m": document.pop("depth_error"),
            "depth_from": document.pop("depth_from"),
            "secant_n_per_m": document.pop("secant"),
            "secant_change_per_0.1mm": document.pop("secant_change"),
        }
        del document["times"]
        document["relaxation_times_s"] = [one._asdict() for one in self.times]
        return document


def inertia(frequency: float) -> float:
    """Return the decrease of k [N/m] that a mass of 100 g causes at a frequency [Hz]."""
    return 0.1 * (2.0 * math.pi * frequency) ** 2


def stiffness_result(
    record: SmoothedRecord,
    phases: Phases,
    local: LocalStiffness | None,
    other: LocalStiffness | None,
    transmission: TransmissionCalibration,
    faults: Sequence[Reason] = (),
) -> StiffnessResult:
    """Return k and b of a record with 95 % intervals, or the reasons why they are not reported.

    `local` is None if there are too few samples for a fit. `other` is fitted with another smoothing
    bandwidth; its difference from `local` widens the intervals, and so do the errors of the
    calibrated transmission. `faults` are the remarks on faults of the logger
    (`teleop.evaluation.batch.sampling_checks`).
    """
    against = reasons_before_fit(record, phases)
    if local is None and not against:
        against.append(
            Reason("too few samples in contact: expected a longer record or a faster rate")
        )
    if local is None or against:
        return without_result([*against, *faults])
    second = other or local
    x, v = record.x[phases.usable], record.v[phases.usable]
    power = max(float((v**2).mean()), 1e-300)
    per_speed = float(np.abs(v).mean()) / power
    # the largest frequencies of the motion determine the effect of the form of the lag
    a = np.gradient(record.v, record.period)[phases.usable]
    omega = max(float(a.std()) / math.sqrt(power), 1e-3)
    (k_by_lag, k_by_lost_motion), (b_by_lag, b_by_lost_motion) = local.best.by_transmission.tolist()
    position_error = math.hypot(record.x_noise, record.count / math.sqrt(12.0))
    half_k = math.hypot(
        LEVEL_95 * math.hypot(local.k_std, 0.5 * (local.k - second.k)),
        transmission.propagated(k_by_lag, k_by_lost_motion, position_error),
        local.k * transmission.form_error(omega).real,
    )
    half_b = math.hypot(
        LEVEL_95 * math.hypot(local.b_std, 0.5 * (local.b - second.b)),
        transmission.propagated(b_by_lag, b_by_lost_motion),
        local.k * transmission.form_error(omega).imag / omega,
    )
    if not frequency_of_loss(local):
        share = damping_at_position(record, phases, local, transmission.compliance)
        half_b = math.hypot(half_b, UNCERTAIN_CORRECTION * (share - 1.0) * local.b)
        local = replace(local, b=share * local.b)
    lock_in = None
    if record.sinusoidal and phases.free_force is None and frequency_of_loss(local):
        lock_in = complex_stiffness(record, local.curved)
    if lock_in and not local.is_linear:
        # the fundamentals determine the loss of a sine, the models also how it depends on depth
        omega = 2.0 * math.pi * record.frequency
        correction = transmission.damping_error(local.k, per_speed, omega)
        half = math.hypot(lock_in.loss_half / omega, correction)
        if half < half_b:
            local, half_b = replace(local, b=lock_in.loss / omega), half
    # a mass changes the slopes of cycles of different frequencies, friction those of all cycles
    cycles = cycles_of(
        replace(record, f=local.best.force_without_mass_and_friction(record)), phases
    )
    change, drift = change_over_cycles(cycles), drift_of_lag(cycles)
    if not local.best.times and local.best.rms < CONSTANT_RESIDUAL * record.f_noise_smoothed:
        change = drift = None  # one law of the depth describes all cycles
    where = measured_point(record, phases, local, half_k)
    against = reasons_after_fit(record, phases, local, half_k)
    if change and (against or change.with_frequency):
        against = [Reason(change.text)]
    if drift and drift.phase > LARGEST_PHASE_DRIFT:
        against = [Reason(drift.text)]
    line = interference(record)
    if line and line.hides_stiffness:
        against = [Reason(line.text)]
    if not change and (gap := gap_at(record, phases, local)):
        against = [gap]
    if isinstance(where, Reason):
        # a change and interference have remarks of their own, and also change the slopes of cycles
        if not change and not line and not against:
            against.append(where)
        where = Point(local.best.force, local.best.position)
    if against:
        return without_result([*against, *faults])
    half_k = math.hypot(half_k, where.difference)
    if change:
        half_k = max(half_k, *(abs(local.k - k) for k in change.k))
    if line:
        faults = [*faults, Reason(line.text)]
    found = [*faults, *remarks(record, phases, local, change), *unknown_form(transmission, omega)]
    inertia_at_hz = record.frequency if record.sinusoidal and not local.best.part(MASS) else None
    if inertia_at_hz and (change_of_k := inertia(inertia_at_hz)) > NOTABLE_INERTIA * local.k:
        found.append(
            Reason(
                f"inertia: 100 g that move beyond the force sensor decrease k by "
                f"{STIFFNESS.text(change_of_k, '.3g')} at {inertia_at_hz:.3g} Hz, and a single "
                "sine cannot show this"
            )
        )
    along_depth = change_of_speed_with_depth(x, v, local.best.position)
    one_speed = along_depth is not None
    if local.best.part(DEPTH_DAMPING) and not one_speed:
        along_depth = change_of_single_speed(x, v, local.best.position)
    half_k = math.hypot(half_k, (along_depth or 0.0) * (abs(local.b) + half_b))
    unusable = unknown = no_damping(v, local, half_b, drift, transmission, one_speed)
    if unknown:
        found.append(unknown)
    elif half_b > abs(local.b):
        unusable = Reason(DAMPING_NOT_RESOLVED)
        found.append(unusable)
    elif local.loss_force is not None:
        found.append(
            Reason(
                "the speed in contact hardly changes: friction in the specimen would have the same "
                f"effect as damping, and both together are {local.loss_force:.3g} N"
            )
        )
    by_lag = 1e-3 * local.k  # decrease of b for each millisecond
    if not unknown and not record.force_lag and by_lag > NOTABLE_LAG * abs(local.b):
        beside = " besides that of its filter" if record.filter_delay else ""
        remark = Reason(
            f"a lag of the force{beside} is not known: each millisecond of it makes b smaller by "
            f"{DAMPING.text(by_lag, '.3g')}; a lag of the position makes b larger by as much",
            LAG,
        )
        found.append(remark)
        if by_lag > LARGEST_LAG_EFFECT * abs(local.b):
            unusable = unusable or remark
    interval = Interval(local.k, local.k - half_k, local.k + half_k)
    k_tip, too_compliant = stiffness_at_tip(interval, transmission)
    found += too_compliant
    point, level = phases.contact_point, phases.free_force
    if local.baseline_size > 0.0:  # contact point and level change with the baseline
        point = level = None
    zero = zero_of_depth(record, phases, local)
    force, position, _ = where
    depth = position - zero
    secant = secant_change = None
    elastic = elastic_force(record, phases, local, position)
    if level is not None and elastic is not None and depth > 0.0:
        secant = (elastic - level) / depth
        secant_change = DATUM_ERROR / depth
    lowest = "lowest position" if phases.free_force is None else "lowest position in contact"
    depth_from = "contact point" if point else lowest
    reasons, hints = texts_and_hints(found)
    return StiffnessResult(
        k=local.k,
        k_low=local.k - half_k,
        k_high=local.k + half_k,
        b=None if unknown else local.b,
        b_low=None if unknown else local.b - half_b,
        b_high=None if unknown else local.b + half_b,
        identifiable=True,
        reasons=reasons,
        hints=hints,
        force=force if level is None else force - level,
        position=position,
        depth=depth,
        secant=secant,
        secant_change=secant_change,
        # a change of the stiffness looks like a relaxation
        times=local.times if any("force relaxes" in text for text in reasons) else (),
        depth_error=0.5 * (point.high - point.low) if point else 0.0,
        depth_from=depth_from,
        b_reason=unusable.text if unusable else "",
        damping_at_hz=frequency_of_loss(local),
        k_tip=k_tip,
        storage_at_hz=record.frequency if is_storage(record, phases, local) else None,
        inertia_at_hz=inertia_at_hz,
        parts=described(local, zero, surface(record, phases, local), level or 0.0),
    )


def damping_at_position(
    record: SmoothedRecord, phases: Phases, local: LocalStiffness, compliance: float
) -> float:
    """Return the damping at the position of k, relative to its mean over the motion.

    Behind a compliance c, specimen and transmission in series have the stiffness k / (1 + c k) and
    the damping b / (1 + c k)^2. If k depends on depth, this damping does too. The fitted damping is
    its mean with the weight v^2; with the velocity of the tip, only one factor 1 / (1 + c k) is
    averaged. A model whose damping depends on depth has that at the position.
    """
    if not compliance or local.best.part(DEPTH_DAMPING):
        return 1.0
    x, v = record.x[phases.usable], record.v[phases.usable]
    elastic = record.f[phases.usable] - local.b * v
    law = np.polynomial.Polynomial.fit(x, elastic, SERIES_DEGREE).deriv()
    averaged = 1 if math.isnan(local.frequency) else 2
    damping = np.clip(1.0 - compliance * law(x), 0.0, 1.0) ** averaged
    here = float(np.clip(1.0 - compliance * law(local.best.position), 0.0, 1.0)) ** averaged
    return here / max(float(np.average(damping, weights=v**2)), 1e-300)


def frequency_of_loss(local: LocalStiffness) -> float | None:
    """Return the frequency [Hz] at which b is k''/omega; None if b is a part of the loss.

    With friction or damping that depends on the depth, b is the derivative of the force to the
    velocity at the depth of k.
    """
    part = local.best.part(FRICTION) or local.best.part(DEPTH_DAMPING)
    return local.frequency if math.isfinite(local.frequency) and not part else None


def stiffness_at_tip(
    k: Interval, transmission: TransmissionCalibration
) -> tuple[Interval | None, list[Reason]]:
    """Return the stiffness at the tip, and the reason if it is not determined."""
    if not transmission.compliance:
        return None, []
    k_tip = transmission.at_tip(k)
    if k_tip:
        return k_tip, []
    return None, [
        Reason(
            "the stiffness at the tip is not determined: the transmission with "
            f"{transmission.compliance * 1e6:.4g} um/N is hardly stiffer than the whole"
        )
    ]


def is_storage(record: SmoothedRecord, phases: Phases, local: LocalStiffness) -> bool:
    """Return whether k is the storage stiffness: a sine in contact throughout, on a linear body."""
    return local.is_linear and record.sinusoidal and phases.free_force is None


def with_lost_motion(
    result: StiffnessResult, plain: LocalStiffness, found: LostMotion
) -> StiffnessResult:
    """Return the result of a record that is corrected for lost motion found in the record itself.

    The shape of the hysteresis is not known, and friction that builds up gradually is corrected
    only in part. The intervals therefore contain a part of the correction, which is the difference
    from the stiffness and damping without it (`plain`). If the amplitude is small compared with the
    lost motion, b, or both k and b, are not determined.
    """
    text = (
        f"lost motion of about {found.half_width * 1e6:.3g} um (half width, 95 % interval "
        f"{max(found.half_width - found.error, 0.0) * 1e6:.3g} to "
        f"{(found.half_width + found.error) * 1e6:.3g}) between position sensor and tip"
    )
    amplitude = f"the amplitude in contact of {found.amplitude * 1e3:.3g} mm"
    if found.amplitude < LEAST_AMPLITUDE_FOR_K * found.half_width:
        text += f": {amplitude} is too small for k and b"
        return without_result([Reason(text, MEASURE)])
    if result.k is None or result.k_high is None:
        return replace(result, reasons=(text, *result.reasons), hints=(*result.hints, MEASURE))
    half_k = math.hypot(result.k_high - result.k, UNCERTAIN_CORRECTION * (result.k - plain.k))
    if half_k > WIDEST_INTERVAL * result.k:
        text += f": the correction of k, from {STIFFNESS.text(plain.k)}, is too large"
        return without_result([Reason(text, MEASURE)])
    half_b = None
    without = f"{STIFFNESS.text(plain.k)} and {DAMPING.text(plain.b)}"
    text += f", which is removed; without this correction, k and b are {without}"
    if result.b is not None and result.b_high is not None:
        half_b = math.hypot(result.b_high - result.b, UNCERTAIN_CORRECTION * (result.b - plain.b))
        if found.amplitude < LEAST_AMPLITUDE_FOR_B * found.half_width:
            too_small = f"{amplitude} is too small beside the lost motion"
            result = replace(result, b=None, b_low=None, b_high=None, b_reason=too_small)
            text += f"; {amplitude} is too small for b"
    widened = with_half_widths(result, half_k, half_b)
    return replace(
        widened,
        lost_motion=found.interval,
        reasons=(text, *widened.reasons),
        hints=(*widened.hints, MEASURE),
    )


def with_possible_lost_motion(
    result: StiffnessResult, corrected: StiffnessResult, found: LostMotion
) -> StiffnessResult:
    """Return a result whose intervals contain those without a lost motion that is not confirmed.

    `corrected` is the result if the lost motion is removed (`with_lost_motion`).
    """
    text = (
        "there is no lost motion, or one of about "
        f"{found.half_width * 1e6:.3g} um between position sensor and tip"
    )
    return with_alternative(result, corrected, Reason(text, MEASURE))


def with_alternative(
    result: StiffnessResult, other: StiffnessResult, cause: Reason
) -> StiffnessResult:
    """Return a result whose intervals contain those of another one, which is also possible.

    `cause` states what the other result takes into account.
    """
    if result.k is None or other.k is None:
        return result
    half_k = max(abs(end - result.k) for end in (*result.interval("k"), *other.interval("k")))
    half_b, values = None, STIFFNESS.text(other.k)
    if result.b is not None and other.b is not None:
        ends = (*result.interval("b"), *other.interval("b"))
        half_b = max(abs(end - result.b) for end in ends)
        values += f" and {DAMPING.text(other.b)}"
    text = f"{cause.text}; the intervals contain both, and the second would give {values}"
    widened = with_half_widths(result, half_k, half_b)
    hints = (*widened.hints, cause.hint) if cause.hint else widened.hints
    return replace(widened, reasons=(text, *widened.reasons), hints=hints)


def with_moving_contact(result: StiffnessResult) -> StiffnessResult:
    """Return the result of a record whose position was corrected for a moving contact point.

    The form of the motion in a press is not known, and the motion is a part of the velocity.
    """
    if result.k is None or result.b is None or result.k_high is None or result.b_high is None:
        return result
    by_form = LEVEL_95 * MOTION_FORM_ERROR * result.b
    half_b = math.hypot(result.b_high - result.b, by_form)
    return with_half_widths(result, result.k_high - result.k, half_b)


def with_half_widths(
    result: StiffnessResult, half_k: float, half_b: float | None
) -> StiffnessResult:
    """Return a result with other half widths of the intervals of k, also at the tip, and of b.

    `half_b` has no effect if b is not determined, and None keeps the interval of b.
    """
    assert result.k is not None
    k_tip = result.k_tip and Interval(
        result.k_tip.value,
        *(
            result.k_tip.value + sign * half_k * (result.k_tip.value / result.k) ** 2
            for sign in (-1.0, 1.0)
        ),
    )
    b, reasons = result.b, result.reasons
    found = replace(result, k_low=result.k - half_k, k_high=result.k + half_k, k_tip=k_tip)
    if b is None or half_b is None:
        return found
    found = replace(found, b_low=b - half_b, b_high=b + half_b)
    if half_b <= abs(b) or DAMPING_NOT_RESOLVED in reasons:
        return found
    return replace(found, b_reason=DAMPING_NOT_RESOLVED, reasons=(*reasons, DAMPING_NOT_RESOLVED))


MEASURE = (
    "teleop lag --stiffness measures lost motion with a spring; --transmission removes it exactly"
)


def without_result(against: Sequence[Reason]) -> StiffnessResult:
    """Return a result in which k and b are None, for a record that does not determine them."""
    reasons, hints = texts_and_hints(against)
    return StiffnessResult(reasons=reasons, hints=hints)


def texts_and_hints(found: Sequence[Reason]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the texts of reasons, and their hints: the two fields of `Reason`, as two tuples.

    A hint that several reasons have is returned once. Empty hints are omitted.
    """
    hints = dict.fromkeys(one.hint for one in found if one.hint)
    return tuple(one.text for one in found), tuple(hints)
