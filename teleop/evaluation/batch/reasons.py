"""Find the reasons why no stiffness is reported for a record, and the remarks on a stiffness."""

from __future__ import annotations

import numpy as np

from estimation.baseline import BELOW
from estimation.quantities import STIFFNESS
from teleop.evaluation.batch.constancy import Change
from teleop.evaluation.batch.local_stiffness import LocalStiffness, merged
from teleop.evaluation.batch.phases import Phases
from teleop.evaluation.batch.prepared import Prepared
from teleop.evaluation.batch.unsuited import negative_force, no_contact, too_few_per_cycle, unsuited
from teleop.evaluation.reason import INVERT_BOTH, Reason

LOWEST = 0.1
"""Fraction of the travel, from the lowest position, that is assumed to be out of contact."""
CONSTANT = 0.02
"""Largest standard deviation of the force out of contact, as a fraction of the force range."""
PULL = 0.05
"""Smallest adhesion that is reported, as a fraction of the force range."""
PULL_NOISE = 6.0
"""Smallest adhesion that is reported, in standard deviations of the noise of the smoothed force."""


def adhesion(record: Prepared) -> float | None:
    """Return the largest adhesion force [N]; None if there is no adhesion.

    If the specimen adheres to the tip, it pulls the tip during the retraction. The force is then
    lower than the force out of contact. The result is the difference of these two forces.
    """
    x, f = record.x, record.f
    span = float(np.ptp(f))
    out = f[x < x.min() + LOWEST * float(np.ptp(x))]
    if span == 0.0 or float(np.std(out)) > CONSTANT * span:
        return None
    pull = float(np.median(out) - f.min())
    return pull if pull > max(PULL * span, PULL_NOISE * record.f_noise_smoothed) else None


def contact_remarks(record: Prepared, local: LocalStiffness) -> list[Reason]:
    """Return remarks on adhesion, a single ramp, friction, and a negative force, if they apply.

    Parameters
    ----------
    record
        The prepared record. Its stiffness is identifiable.
    local
        Stiffness and damping of the record.
    """
    found = []
    if pull := adhesion(record):
        found.append(
            Reason(f"adhesion: the force falls by {pull:.3g} N below its level out of contact")
        )
    if record.ramp:
        found.append(
            Reason(
                "one ramp: a drift of the force during the ramp has the same effect as a "
                "stiffness; expected a motion that reverses, to see the difference"
            )
        )
    if local.friction:
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


WIDEST = 0.5
"""If the half width of the 95 % interval of k is larger than this fraction of k, k is not
identifiable."""
MOTION = 10.0
"""Smallest travel in contact with which k is fitted, in units of 2.5 standard deviations of the
noise of the position."""
DEPTH = 0.02
"""Smallest travel in contact with which k is fitted, as a fraction of the travel of the record."""
POOR = 0.9
"""If R^2 of the best model is below this limit, a remark on the bad fit is made."""
EXPLAINED = 0.8
"""If R^2 of the best model is below this limit, no stiffness is reported, provided that the record
contains free motion or the misfit is structural (`STRUCTURAL`)."""
STRUCTURAL = 4
"""If the best polynomial has at least this degree, a bad fit is attributed to the structure of the
model (structural misfit). With a lower degree, it is attributed to noise."""
CONSTANT_SPEED = 1e-9
"""If the standard deviation of the velocity is below this fraction of the mean speed, the speed
counts as constant."""
SLIGHT = 0.02
"""If the residual of the Kelvin-Voigt model is below this fraction of the typical force, the model
is sufficient. The typical force is 0.35 times the force range, which is the root mean square of a
sine."""
SMALL_BASELINE = 0.05
"""Peak-to-peak size of the baseline below which no remark on it is made, as a fraction of the force
range. The baseline is the part of the force that is slower than the palpation."""
FEWEST_INDEPENDENT = 35
"""Number of independent samples that the intervals need. If there are fewer, a remark says so.

With fewer samples, the error model for four parameters has fewer than four cosines
(`robust_error`).
"""
HOLD = 0.5
"""Shortest hold in contact [s] in which a relaxation of the force can be distinguished from lost
motion (backlash). Both have a similar effect on the force in a motion without such a hold."""
LOST_MOTION = "motion is lost between the position sensor and the tip"
SLOPES = "teleop estimate FILE --json prints the slope of each loading (phases)"
LAG = (
    "teleop lag measures a lag of the force; --conditioning matched --force-lag LAG compensates it"
)


def reasons_before_fit(record: Prepared, phases: Phases) -> list[Reason]:
    """Return the reasons why no stiffness can be fitted to a record; empty if there are none.

    Parameters
    ----------
    record
        The prepared record.
    phases
        Contact and phases of the motion in the record.
    """
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
        found.append(Reason(no_contact(record)))
    elif not phases.usable.any():
        found.append(Reason("contact is too short for the smoothing: expected longer contact"))
    else:
        inside = record.x[phases.usable]
        travel = float(np.ptp(inside))
        if travel < 2.5 * MOTION * record.x_noise:
            found.append(
                Reason(
                    too_few_per_cycle(record)
                    or f"in contact the position moves by {travel * 1e6:.3g} um, too little for "
                    f"its noise of {record.x_noise * 1e6:.2g} um: a rigid stop, or a position "
                    "sensor that does not resolve the indentation"
                )
            )
        elif phases.free_force is not None and travel < DEPTH * float(np.ptp(record.x)):
            found.append(
                Reason(
                    f"in contact the position moves by {travel * 1e6:.3g} um of "
                    f"{np.ptp(record.x) * 1e6:.4g} um: a rigid stop"
                )
            )
    return found


def reasons_after_fit(local: LocalStiffness, half_k: float, phases: Phases) -> list[Reason]:
    """Return the reasons why a fitted stiffness is not reported; empty if there are none.

    Parameters
    ----------
    local
        The fitted stiffness and damping.
    half_k
        Half width of the 95 % interval of the stiffness [N/m].
    phases
        Contact and phases of the motion in the record.
    """
    if local.k + half_k < 0.0:
        return [
            Reason(
                f"the stiffness is negative ({STIFFNESS.text(local.k)}): expected force and "
                "position positive in compression, and forces of inertia that do not dominate",
                "--invert reverses the sign of force or position",
            )
        ]
    structural = phases.free_force is not None or local.best.degree >= STRUCTURAL
    if structural and local.r2 < EXPLAINED:
        return [
            Reason(
                f"in contact the position explains {local.r2:.0%} of the force variance: a rigid "
                "stop, slip, or a specimen that changes"
            )
        ]
    if half_k > WIDEST * abs(local.k) or local.k < 0.0:
        where = "" if phases.free_force is None else " in contact"
        why, hint = "no contact, noise, or too little motion", ""
        if local.r2 > POOR and local.best.degree > 1:
            why, hint = "it depends on depth or time", SLOPES
        return [
            Reason(
                f"the force does not follow the displacement well enough{where}: stiffness "
                f"{STIFFNESS.number(local.k)} \u00b1 "
                f"{STIFFNESS.text(half_k)} ({why})",
                hint,
            )
        ]
    return []


def remarks(
    record: Prepared, phases: Phases, local: LocalStiffness, half_b: float, change: Change | None
) -> list[Reason]:
    """Return the remarks on a record whose stiffness is reported.

    A remark informs the user, for example, that the Kelvin-Voigt model does not fit well.

    Parameters
    ----------
    record, phases, local
        The prepared record, its phases of motion, and the fitted stiffness and damping.
    half_b
        Half width of the 95 % interval of the damping b [N s/m].
    change
        Change of the stiffness between the first and the last cycles of the record; None if the
        stiffness does not change.
    """
    found = []
    best, plain = local.best, local.kelvin_voigt
    size = float(np.ptp(record.f[phases.usable]))
    slight = plain.rms < SLIGHT * 0.35 * size
    if change:
        found.append(Reason(change.text))
    elif (
        best is not plain
        and not slight
        and best.bic < plain.bic - 10.0
        and plain.rms > 1.05 * best.rms
    ):
        what = [f"the stiffness depends on depth (degree {best.degree})"] if best.degree > 1 else []
        if best.times:
            times = ", ".join(f"{tau:.2g} s" for tau in merged(best.times))
            similar = "" if longest_hold(record, phases) >= HOLD else f", or {LOST_MOTION}"
            what.append(f"force relaxes ({times}){similar}")
        found.append(
            Reason(
                f"Kelvin-Voigt is insufficient: {' and '.join(what)}; residual {plain.rms:.2g} N, "
                f"and {best.rms:.2g} N with that in the model"
            )
        )
    found += contact_remarks(record, local)
    if local.r2 < POOR:
        found.append(
            Reason(
                f"bad fit: {1.0 - local.r2:.0%} of the force variance in contact is not explained"
            )
        )
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
    v = record.v[phases.usable]
    if float(np.std(v)) < CONSTANT_SPEED * float(np.mean(np.abs(v))):
        found.append(
            Reason("the speed in contact is constant: damping is not determined, and given as 0")
        )
    elif half_b > abs(local.b):
        found.append(Reason("damping is not resolved: its interval contains zero"))
    elif local.b < 0.0:
        found.append(negative_damping(record.force_lag))
    return found


def longest_hold(record: Prepared, phases: Phases) -> float:
    """Return the duration of the longest hold in contact [s]; 0 if there is no hold.

    In a hold, the position is nearly constant.
    """
    holds = (
        phase.end - phase.start
        for phase in phases.phases
        if phase.name == "hold" and phases.contact[phase.start : phase.end].all()
    )
    return record.period * max(holds, default=0)


def negative_damping(force_lag: float) -> Reason:
    """Return the remark that the fitted damping is negative, with its possible causes.

    Parameters
    ----------
    force_lag
        Lag of the force that was compensated before the fit [s]; 0 if no lag was compensated.
    """
    lost = f"{LOST_MOTION}, which biases k too"
    if not force_lag:
        lags = "damping is negative: the force lags behind the position"
        return Reason(f"{lags}, or {lost}", LAG)
    return Reason(
        f"damping is negative although the force lag is compensated: {lost}, or the lag of the "
        f"force is longer than the compensated lag ({force_lag * 1e3:g} ms)"
    )
