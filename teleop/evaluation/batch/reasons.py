"""Find the reasons why no stiffness is reported for a record, and the remarks on a stiffness."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

from estimation.arrays import Floats
from estimation.baseline import BELOW
from estimation.estimator import LEVEL_95
from estimation.quantities import DAMPING, STIFFNESS
from estimation.stiffening import Interval
from estimation.transmission import TransmissionCalibration
from teleop.evaluation.batch.candidate import FRICTION, Candidate
from teleop.evaluation.batch.constancy import Change, LagDrift, rise_at_rest
from teleop.evaluation.batch.contact_phases import Phases, adhesion, pull_off_force
from teleop.evaluation.batch.depth import surface
from teleop.evaluation.batch.extension_texts import phrases
from teleop.evaluation.batch.local_stiffness import LocalStiffness
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.batch.sampling_checks import impossible_lag, opposite_signs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.strokes import is_single_stroke, typical_speed
from teleop.evaluation.batch.thresholds import (
    BAD_FIT_R2,
    BETTER_BIC,
    BETTER_RESIDUAL,
    CONSTANT_SPEED,
    CREEP_NOISE,
    DRIFT_OF_RESIDUAL,
    FEWEST_INDEPENDENT,
    FEWEST_SAMPLES_PER_CYCLE,
    FREE_SPEED,
    LARGEST_CHANGE_BY_LAG,
    LARGEST_STOP_TRAVEL,
    LARGEST_TIME_RATIO,
    LARGEST_ZERO_FORCE,
    LEAST_CONTACT_MOTION,
    LEAST_CREEP,
    LEAST_DEPTH,
    LEAST_LEVEL_WIDTH,
    LEAST_RISE_OF_FORCE,
    LEAST_STOP_FORCE,
    LEVEL_WIDTH_NOISE,
    LOADING_SPEED,
    LONGEST_LAG,
    LONGEST_LAG_SHARE,
    NEAR_POSITION,
    NO_RESULT_R2,
    NOTABLE_CHANGE,
    NOTABLE_FORM,
    PUNCTURE_FALL,
    PUNCTURE_NOISE,
    PUNCTURE_TIME,
    PUNCTURE_TRAVEL,
    RELAXATION_MISFIT,
    SHORTEST_CREEP,
    SHORTEST_RELAXATION_HOLD,
    SINGLE_SPEED,
    SMALL_BASELINE,
    SPEED_DEGREE,
    STEEPEST_LOSS,
    STRUCTURAL_DEGREE,
    SUFFICIENT_RESIDUAL,
    VISCOUS_SHARE,
    WIDEST_INTERVAL,
    WITHOUT_MEANING,
)
from teleop.evaluation.reason import INVERT_BOTH, Reason

SMOOTHED = 9
"""Length of the median filter that is applied before the search for a puncture [samples]."""


def unsuited(record: SmoothedRecord, phases: Phases) -> Reason | None:
    """Return the reason why a test gives no tangent stiffness; None if no reason is found.

    The function searches for inverted signs of force and position, a creep test, a puncture of the
    specimen, and a drift of the force at rest.
    """
    if reason := impossible_lag(record) or opposite_signs(record):
        return reason
    if phases.saturated and rests_at_zero(record):
        return Reason(
            "the force rests near zero at the highest positions, and is negative at the lowest: "
            "expected force and position positive in compression",
            INVERT_BOTH,
        )
    if (level := creep_force(record, phases)) is not None:
        return Reason(
            f"the force is constant at {level:.3g} N while the position creeps: a creep test has "
            "no tangent stiffness"
        )
    if (fall := puncture(record, phases)) is not None:
        before, after, position = fall
        return Reason(
            f"the force falls from {before:.3g} to {after:.3g} N in loading, at a position of "
            f"{position * 1e3:.4g} mm: the specimen is punctured, slips or softens suddenly. "
            "Expected a recording that ends before"
        )
    if rise := rise_at_rest(record):
        return Reason(
            f"the force drifts: at a constant position, it rises by {rise[0]:.3g} N in "
            f"{rise[1]:.3g} s, and the force of a passive body does not rise there"
        )
    return None


def no_contact(record: SmoothedRecord) -> str:
    """Return the text of the message that the force does not follow the displacement.

    This function does not check the force. It only uses the record to select one of two texts: the
    text for a motion that never reverses, or the text for any other motion.
    """
    if is_single_stroke(record.raw_x, record.x_noise):
        return (
            f"the force changes by less than {LEAST_RISE_OF_FORCE:g} standard deviations of its "
            "scatter while the position moves in one direction: no contact, or a change that the "
            "force sensor does not resolve"
        )
    return "the force does not follow the displacement: no contact"


def rigid_stop(record: SmoothedRecord) -> str | None:
    """Return the text that the force changes at a constant position; None if this is not so."""
    travel, rise = float(np.ptp(record.x)), float(np.ptp(record.f))
    if (
        travel > LARGEST_STOP_TRAVEL * record.x_noise
        or rise < LEAST_STOP_FORCE * record.f_noise_smoothed
    ):
        return None
    return (
        f"the force changes by {rise:.3g} N, and the position by {travel * 1e6:.3g} um, which is "
        f"not more than its noise: a rigid stop, or a position sensor that does not move"
    )


def rests_at_zero(record: SmoothedRecord) -> bool:
    """Return whether the highest force of a record is nearly zero, relative to the force range.

    If the result is True, the force is nearly zero or negative in the whole record.
    """
    low, high = record.force_range
    return abs(high) < LARGEST_ZERO_FORCE * (high - low)


def negative_force(record: SmoothedRecord) -> bool:
    """Return whether the force is mainly negative.

    This is the case if the lowest force is negative, and its magnitude is more than three times the
    highest force.
    """
    low, high = record.force_range
    return low < 0.0 and high < -low / 3.0


def too_few_per_cycle(record: SmoothedRecord) -> str | None:
    """Return a message if a record has too few samples per cycle of the motion; otherwise None."""
    each = 1.0 / (record.band.centre * record.period)
    if record.band.coherence == 0.0 or each >= FEWEST_SAMPLES_PER_CYCLE:
        return None
    return (
        f"{each:.2g} samples per cycle of {record.band.centre:.3g} Hz: expected a sampling rate of "
        f"{FEWEST_SAMPLES_PER_CYCLE * record.band.centre:.3g} Hz or more"
    )


def creep_force(record: SmoothedRecord, phases: Phases) -> float | None:
    """Return the constant force of a creep test [N]; None for another test.

    In a creep test, the force is constant. The position continues to move in one direction, with
    decreasing speed.
    """
    f, noise = record.f, record.f_noise_smoothed
    level = float(np.median(f[len(f) // 2 :]))
    if max(abs(level), float(np.ptp(f))) < LEAST_STOP_FORCE * noise:
        return None
    width = max(LEVEL_WIDTH_NOISE * noise, LEAST_LEVEL_WIDTH * float(np.ptp(f)))
    for start, end in runs((np.abs(f - level) < width) & phases.contact):
        if end - start < SHORTEST_CREEP * len(f):
            continue
        travels = np.diff(record.x[np.linspace(start, end - 1, 5).astype(np.int_)])
        if (
            (np.diff(travels) < 0.0).all()
            and travels[-1] > CREEP_NOISE * record.x_noise
            and travels.sum() > LEAST_CREEP * float(np.ptp(record.x))
        ):
            return level
    return None


def puncture(record: SmoothedRecord, phases: Phases) -> tuple[float, float, float] | None:
    """Find a puncture of the specimen, at which the force falls suddenly during loading.

    The result is None if there is no puncture.
    """
    f = median_filter(record.raw_f, SMOOTHED, mode="nearest")
    x, v = record.x, record.v
    inward = v > LOADING_SPEED * typical_speed(v)
    gaps = np.array(record.starts[1:], dtype=np.intp)
    inward[gaps] = False  # across a gap, the motion is not known
    inward &= phases.contact
    least = max(PUNCTURE_FALL * float(np.ptp(f)), PUNCTURE_NOISE * record.f_noise)
    for start, end in runs(inward):
        if end - start < 4 * SMOOTHED:
            continue
        longest = max(round(PUNCTURE_TIME * (end - start)), SMOOTHED)
        travel = PUNCTURE_TRAVEL * float(np.ptp(x[phases.contact]))
        before, after = largest_fall(x[start:end], f[start:end], travel, longest)
        if f[start + before] - f[start + after] > least:
            return float(f[start + before]), float(f[start + after]), float(x[start + before])
    return None


def largest_fall(x: Floats, f: Floats, travel: float, longest: int) -> tuple[int, int]:
    """Return the indices of the two samples between which the force falls most.

    Only samples are compared whose positions differ by at most `travel`, and whose indices differ
    by at most `longest`.
    """
    ends = np.searchsorted(np.maximum.accumulate(x), x + travel, side="right") - 1
    ends = np.minimum(ends, np.arange(len(x)) + longest)
    before = int(np.argmax(f - f[ends]))
    return before, int(ends[before])


def contact_remarks(record: SmoothedRecord, local: LocalStiffness) -> list[Reason]:
    """Return remarks on adhesion, a single ramp, friction, and a negative force, if they apply."""
    found = []
    if pull := adhesion(record):
        found.append(
            Reason(
                f"adhesion: the force falls by {pull_off_force(record, pull):.3g} N below its "
                "level out of contact"
            )
        )
    if record.ramp:
        found.append(
            Reason(
                "one ramp: a drift of the force during the ramp has the same effect as a "
                "stiffness; expected a motion that reverses, to see the difference"
            )
        )
    if local.friction and not local.best.part(FRICTION):
        found.append(
            Reason(
                "friction: the loss does not depend on the speed; b holds for this frequency and "
                "amplitude only"
            )
        )
    if negative_force(record):
        found.append(
            Reason(
                "the force is negative: if it is negative in compression, k is that of unloading",
                INVERT_BOTH,
            )
        )
    return found


DAMPING_NOT_RESOLVED = "damping is not resolved: its interval contains zero"
LOST_MOTION = "motion is lost between the position sensor and the tip"
SURFACE_RECOVERS = "each press moves the surface of the specimen, which then recovers"
SOFTENING = "the specimen is softer at depths that it has reached before"
SLOPES = "teleop estimate FILE --json prints the slope of each loading (phases)"
LAG = (
    "teleop lag measures a lag of the force; --conditioning matched --force-lag LAG compensates it"
)


def reasons_before_fit(record: SmoothedRecord, phases: Phases) -> list[Reason]:
    """Return the reasons why no stiffness can be fitted to a record; empty if there are none."""
    if reason := unsuited(record, phases):
        return [reason]
    found = []
    if phases.saturated:
        found.append(
            Reason(
                "the force rests at its highest value while the position moves: the sensor is "
                "saturated, or the specimen slips or yields"
            )
        )
    if record.band.coherence == 0.0:
        found.append(Reason(rigid_stop(record) or no_contact(record)))
    elif not phases.usable.any():
        found.append(Reason("contact is too short for the smoothing: expected longer contact"))
    else:
        inside = record.x[phases.usable]
        travel = float(np.ptp(inside))
        if travel < 2.5 * LEAST_CONTACT_MOTION * record.x_noise:
            found.append(
                Reason(
                    too_few_per_cycle(record)
                    or f"in contact the position moves by {travel * 1e6:.3g} um, too little for "
                    f"its noise of {record.x_noise * 1e6:.2g} um: a rigid stop, or a position "
                    "sensor that does not resolve the indentation"
                )
            )
        elif phases.free_force is not None and float(
            np.ptp(record.x[phases.contact])
        ) < LEAST_DEPTH * float(np.ptp(record.x)):
            found.append(
                Reason(
                    f"in contact the position moves by {travel * 1e6:.3g} um of "
                    f"{np.ptp(record.x) * 1e6:.4g} um: a rigid stop"
                )
            )
    return found


def reasons_after_fit(
    record: SmoothedRecord, phases: Phases, local: LocalStiffness, half_k: float
) -> list[Reason]:
    """Return the reasons why a fitted stiffness is not reported; empty if there are none."""
    if reason := viscous_body(record, phases, local, half_k):
        return [reason]
    if local.k + half_k < 0.0:
        return [
            Reason(
                f"the stiffness is negative ({STIFFNESS.text(local.k)}): expected force and "
                "position positive in compression, and forces of inertia that do not dominate",
                "--invert reverses the sign of force or position",
            )
        ]
    structural = phases.free_force is not None or local.best.degree >= STRUCTURAL_DEGREE
    if structural and local.r2 < NO_RESULT_R2:
        return [
            Reason(
                f"in contact the position explains {local.r2:.0%} of the force variance: a rigid "
                "stop, slip, or a specimen that changes"
            )
        ]
    if half_k > WIDEST_INTERVAL * abs(local.k) or local.k < 0.0:
        where = "" if phases.free_force is None else " in contact"
        value = f"{STIFFNESS.number(local.k)} \u00b1 {STIFFNESS.text(half_k)}"
        travel, range_of_force = float(np.ptp(record.x)), float(np.ptp(record.f))
        if half_k * travel > WITHOUT_MEANING * max(abs(local.k) * travel, range_of_force):
            value = f"{STIFFNESS.text(local.k)} \u00b1 more than {WITHOUT_MEANING:.0%}"
        if local.r2 < BAD_FIT_R2:
            return [
                Reason(
                    f"the force does not follow the displacement well enough{where}: stiffness "
                    f"{value} (no contact, noise, or too little motion)"
                )
            ]
        # the models explain the force, but do not agree on k
        why, hint = "noise, or too little motion", ""
        if local.best.times:
            why = "the force relaxes, and models that describe it equally well do not agree on k"
            if max(local.best.times) > float(record.clock[-1]):
                why = "the force changes slowly over the record: it drifts, or the tip slides"
        elif local.best.degree > 1:
            why, hint = "it depends on depth or time", SLOPES
        return [Reason(f"the stiffness is not determined{where}: {value} ({why})", hint)]
    return []


def viscous_body(
    record: SmoothedRecord, phases: Phases, local: LocalStiffness, half_k: float
) -> Reason | None:
    """Return the reason that the body is viscous: its force follows the velocity, without k."""
    x, v = record.x[phases.usable], record.v[phases.usable]
    time_of_motion = float(np.std(x)) / max(float(np.std(v)), 1e-300)
    half_b, largest = LEVEL_95 * local.b_std, abs(local.k) + half_k
    if local.k > half_k or largest * time_of_motion > VISCOUS_SHARE * (local.b - half_b):
        return None
    return Reason(
        f"the force follows the velocity, not the position: a viscous body with "
        f"{local.b:.4g} \u00b1 {DAMPING.text(half_b, '.2g')}, whose stiffness is below "
        f"{STIFFNESS.text(largest, '.2g')}, or a motion that is too fast for its stiffness"
    )


def remarks(
    record: SmoothedRecord,
    phases: Phases,
    local: LocalStiffness,
    change: Change | None,
) -> list[Reason]:
    """Return the remarks on a record whose stiffness is reported, except those on damping.

    A remark informs the user, for example, that the Kelvin-Voigt model does not fit well.
    """
    found = []
    best, plain = local.best, local.kelvin_voigt
    size = float(np.ptp(record.f[phases.usable]))
    slight = plain.rms < SUFFICIENT_RESIDUAL * 0.35 * size
    changed = bool(best.parts) and abs(plain.k - best.k) > NOTABLE_CHANGE * abs(best.k)
    if change:
        found.append(Reason(change.text))
    elif (
        best is not plain
        and not best.is_storage  # k' and k'' are those of any linear body
        and (changed or (not slight and plain.rms > BETTER_RESIDUAL * best.rms))
        and best.bic < plain.bic - BETTER_BIC
    ):
        what = phrases(local, surface(record, phases, local), record.sinusoidal)
        if best.times and not local.lag:
            times = ", ".join(time_text(tau) for tau in local.times)
            similar = ""
            if best.rms > RELAXATION_MISFIT * record.f_noise_smoothed:
                similar += f", or {SOFTENING}"
            if longest_hold(record, phases) < SHORTEST_RELAXATION_HOLD:
                similar += f", or {LOST_MOTION}"
                if phases.free_force is not None:
                    similar += f", or {SURFACE_RECOVERS}"
            what.append(f"force relaxes ({times}){similar}")
        if what:
            found.append(
                Reason(
                    f"Kelvin-Voigt is insufficient: {' and '.join(what)}; residual {plain.rms:.2g} "
                    f"N, and {best.rms:.2g} N if the model contains this"
                )
            )
    found += contact_remarks(record, local)
    if local.r2 < BAD_FIT_R2:
        text = f"bad fit: {1.0 - local.r2:.0%} of the force variance in contact is not explained"
        if drift := drift_of_residual(record, phases, best):
            text += (
                f", because the force drifts by {abs(drift):.3g} N over the record. Expected more "
                "cycles, with which a drift is removed"
            )
        found.append(Reason(text))
    if local.baseline_size > SMALL_BASELINE * size:
        found.append(
            Reason(
                f"a baseline is removed ({local.baseline_size:.3g} N peak to peak, below "
                f"{BELOW * record.band.low:.2g} Hz): drift, relaxation, or a transient at the start"
            )
        )
    if local.samples < FEWEST_INDEPENDENT:
        found.append(
            Reason(
                f"few samples: {local.samples} independent samples in contact, and the intervals "
                f"need {FEWEST_INDEPENDENT}: expected a longer record or a faster rate"
            )
        )
    return found


def time_text(tau: Interval) -> str:
    """Return the text of a time constant [s] with its interval, if it is determined."""
    if tau.high > LARGEST_TIME_RATIO * tau.value:
        return f"about {float(f'{tau.value:.1g}'):g} s"
    digits = max(1 - math.floor(math.log10(max(tau.high - tau.low, 1e-9))), 0)
    return f"{tau.value:.{digits}f} s [{tau.low:.{digits}f}, {tau.high:.{digits}f}]"


def drift_of_residual(record: SmoothedRecord, phases: Phases, best: Candidate) -> float | None:
    """Return the change over the record of a line through the residual of a model [N].

    The result is None if the line is not the largest part of the residual.
    """
    t = record.clock[RegressionRows(record, phases).index]
    line = np.polynomial.Polynomial.fit(t, best.residual, 1)
    if float(np.var(line(t))) < DRIFT_OF_RESIDUAL * float(np.var(best.residual)):
        return None
    return float(line(record.clock[-1]) - line(record.clock[0]))


def no_damping(
    v: Floats,
    local: LocalStiffness,
    half_b: float,
    drift: LagDrift | None,
    transmission: TransmissionCalibration,
    one_speed: bool,
) -> Reason | None:
    """Return the reason why a record with a stiffness determines no damping; otherwise None.

    `v` is the velocity in contact, and `one_speed` states whether each depth has one speed
    (`change_of_speed_with_depth`). The damping of a passive body is not negative.
    """
    if float(np.std(v)) < CONSTANT_SPEED * float(np.mean(np.abs(v))):
        return Reason("the speed in contact is constant: damping is not determined")
    if local.loss_force is not None and local.best.part(FRICTION):
        return Reason(
            "the speed in contact hardly changes, so that damping and friction in the specimen are "
            "one force: damping is not determined"
        )
    if drift:
        return Reason(f"{drift.text}: damping is not determined")
    if local.lag and abs(local.lag.b - local.b) > LARGEST_CHANGE_BY_LAG * local.lag.b:
        more = " besides the compensated lag" if transmission.force_lag else ""
        return Reason(
            f"the force lags behind the position by about {local.lag.seconds * 1e3:.2g} ms{more}, "
            "which describes it better than a relaxation: damping is not determined",
            LAG,
        )
    if local.b + half_b < 0.0:
        if local.best.times:
            return Reason(
                f"damping is not determined: beside the relaxation of the force, it is negative "
                f"({DAMPING.text(local.b, '.3g')}). The model does not describe the relaxation "
                "exactly, or the force lags behind the position",
                LAG,
            )
        # besides relaxation, b is not the loss at a frequency, and shows no phase
        period = 1.0 / local.frequency if np.isfinite(local.frequency) else np.inf
        return negative_damping(local.b, transmission, -local.b / local.k, period)
    if one_speed:
        return Reason(
            "each depth is passed with one speed: damping is not determined, because a stiffness "
            "that changes with depth has the same effect"
        )
    return None


def change_of_speed_with_depth(x: Floats, v: Floats, position: float) -> float | None:
    """Return |dv/dx| at a position [1/s]; None if depths are passed with different speeds.

    In a single stroke, the speed is a smooth function of the depth. The force b v is then one more
    function of the depth: b is not determined, and changes k by |dv/dx| times its change.
    """
    middle, span = float(x.mean()), max(float(np.ptp(x)), 1e-300)
    scaled = (x - middle) / span
    polynomial = np.polynomial.Polynomial.fit(scaled, v, SPEED_DEGREE)
    rest = v - polynomial(scaled)
    if float(np.std(rest)) > FREE_SPEED * float(np.sqrt(np.mean(v**2))):
        return None
    return abs(float(polynomial.deriv()((position - middle) / span))) / span


def change_of_single_speed(x: Floats, v: Floats, position: float) -> float | None:
    """Return |dv/dx| at a position that is passed in one direction with one speed [1/s].

    At one speed, a damping that depends on depth has the same effect there as a stiffness, also if
    the speeds differ at other depths. The result is None if it is passed with different speeds.
    """
    near = np.abs(x - position) < NEAR_POSITION * float(np.ptp(x))
    if near.sum() < 3 or abs(np.sign(v[near]).sum()) < near.sum():
        return None
    line = np.polynomial.Polynomial.fit(x[near], v[near], 1)
    if float(np.std(v[near] - line(x[near]))) > SINGLE_SPEED * float(np.mean(np.abs(v[near]))):
        return None
    return abs(float(line.deriv()(position)))


def longest_hold(record: SmoothedRecord, phases: Phases) -> float:
    """Return the duration of the longest hold in contact [s]; 0 if there is no hold.

    In a hold, the position is nearly constant.
    """
    holds = (
        phase.end - phase.start
        for phase in phases.phases
        if phase.name == "hold" and phases.contact[phase.start : phase.end].all()
    )
    return record.period * max(holds, default=0)


def unknown_form(transmission: TransmissionCalibration, omega: float) -> list[Reason]:
    """Return the remark that the form of the lag of the force is not known, if it matters for k.

    `omega` is the angular frequency of the motion [rad/s].
    """
    change = transmission.form_error(omega).real
    if change < NOTABLE_FORM:
        return []
    return [
        Reason(
            f"the form of the force lag is not known: a pure delay and a first-order lag of "
            f"{transmission.force_lag * 1e3:.3g} ms change k differently, by {change:.1%} either "
            "way",
            "teleop lag measures the form of the lag",
        )
    ]


def negative_damping(
    b: float, transmission: TransmissionCalibration, needed: float, period: float
) -> Reason:
    """Return the reason that the fitted damping is negative, with its possible causes.

    `needed` is the lag of the force that would explain the damping [s], and `period` that of the
    motion [s].
    """
    text = f"damping is not determined: it is negative ({DAMPING.text(b, '.3g')})"
    force_lag = transmission.force_lag
    if 2.0 * np.pi * needed > STEEPEST_LOSS * period:
        return Reason(
            f"{text}. The force would have to lag by {needed * 1e3:.3g} ms, more than "
            "a force channel or lost motion causes: wrong time stamps, a wrong sign, or position "
            "and force of different recordings"
        )
    if transmission.lost_motion and force_lag:
        return Reason(
            f"{text} although a force lag of {force_lag * 1e3:.3g} ms and lost motion "
            f"of {transmission.lost_motion * 1e6:.3g} um are compensated: these values are too "
            "small for this record"
        )
    if transmission.lost_motion:
        return Reason(
            f"{text}: the force lags behind the position, by {needed * 1e3:.2g} ms or more", LAG
        )
    lost = f"{LOST_MOTION}, which biases k too"
    if needed > min(LONGEST_LAG, LONGEST_LAG_SHARE * period):
        return Reason(f"{text}: {lost}; a lag of the force would have to be {needed * 1e3:.3g} ms")
    if not force_lag:
        lags = f"the force lags behind the position, by {needed * 1e3:.2g} ms or more"
        return Reason(f"{text}: {lags}, or {lost}", LAG)
    return Reason(
        f"{text} although the force lag is compensated: {lost}, or the lag of the "
        f"force is longer than the compensated lag ({force_lag * 1e3:g} ms)"
    )
