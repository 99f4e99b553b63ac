"""Compute the result for publication: stiffness and damping with intervals, or reasons for none.

k is the tangent stiffness at half of the force range, in loading (`local_stiffness`). k depends
neither on the zero of position and force nor on the length of the record. The secant stiffness F /
x depends on both. The secant stiffness is reported in addition to k, with the change that a datum
error of 0.1 mm would cause.

The interval accounts for the autocorrelation of the residual, for the spread between models, and
for the change of k with the smoothing bandwidth. If the data are not sufficient for k, both k and b
are None, and `reasons` contains the reasons.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from estimation.estimator import LEVEL_95
from teleop.evaluation.constancy import Change, change_over_cycles
from teleop.evaluation.contact_remarks import contact_remarks
from teleop.evaluation.local_stiffness import LocalStiffness, merged
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.unsuited import too_few_per_cycle, unsuited

WIDEST = 0.5
"""Half width of the interval of k, as a fraction of k, above which k is not identifiable."""
MOTION = 10.0
"""Smallest travel in contact, as a multiple of 2.5 standard deviations of the position noise."""
DEPTH = 0.02
"""Smallest travel in contact, as a fraction of the travel of the record."""
POOR = 0.9
"""R^2 of the best model below which a bad fit is reported."""
EXPLAINED = 0.8
"""R^2 of the best model below which no stiffness is reported, if the contact is intermittent or the
misfit is structural."""
STRUCTURAL = 4
"""Smallest degree of the best polynomial for which a bad fit is called a structural misfit. For a
lower degree, noise is assumed."""
SLIGHT = 0.02
"""Residual of the Kelvin-Voigt model, as a fraction of the force, below which this model is
sufficient."""
SMALL_BASELINE = 0.05
"""Size of the baseline below which it is not reported, as a fraction of the force range."""
FEWEST_INDEPENDENT = 35
"""Smallest number of independent samples for which intervals are reported without a remark.

With fewer samples, the error model for four parameters has fewer than four cosines
(`robust_error`).
"""
DATUM_ERROR = 1e-4
"""Datum error for which the change of the secant stiffness is reported [m]."""


@dataclass(frozen=True)
class Result:
    """Stiffness and damping with 95 % intervals, and the force and depth at which they hold."""

    k: float | None = None
    """Tangent stiffness [N/m]; None if it is not identifiable."""
    k_low: float | None = None
    """Lower end of the 95 % interval of k [N/m]."""
    k_high: float | None = None
    """Upper end of the 95 % interval of k [N/m]."""
    b: float | None = None
    """Damping [N s/m]; None if it is not identifiable."""
    b_low: float | None = None
    """Lower end of the 95 % interval of b [N s/m]."""
    b_high: float | None = None
    """Upper end of the 95 % interval of b [N s/m]."""
    identifiable: bool = False
    """Whether the data are sufficient for k and b."""
    reasons: tuple[str, ...] = ()
    """Reasons why k is not identifiable; if k is identifiable, remarks on the result."""
    force: float | None = None
    """Force at which the tangent stiffness is evaluated: half of the force range [N]."""
    depth: float | None = None
    """Depth at `force`, relative to the contact point or to the lowest position in contact [m]."""
    secant: float | None = None
    """Secant stiffness at `force`: force divided by depth [N/m]."""
    secant_change: float | None = None
    """Relative change of the secant stiffness that a datum error of 0.1 mm causes."""
    times: tuple[float, ...] = field(default=())
    """Relaxation time constants of the best model [s]."""
    depth_from: str = "lowest position"
    """Position at which `depth` is zero: the contact point or the lowest position in contact."""
    damping_at_hz: float | None = None
    """Frequency at which b is k''/omega [Hz]; None if relaxing parts may cause part of the loss."""

    @property
    def b_change_per_ms(self) -> float | None:
        """Change of b for 1 ms of lag of the force that is not compensated [N s/m]."""
        return None if self.k is None else 1e-3 * self.k

    def summary(self) -> dict[str, Any]:
        """Return the result as a dictionary for JSON."""
        document = asdict(self)
        document["reasons"] = list(self.reasons)
        document["b_change_per_ms_of_lag"] = self.b_change_per_ms
        document["tangent"] = {
            "force_n": document.pop("force"),
            "depth_m": document.pop("depth"),
            "depth_from": document.pop("depth_from"),
            "secant_n_per_m": document.pop("secant"),
            "secant_change_per_0.1mm": document.pop("secant_change"),
        }
        document["relaxation_times_s"] = list(document.pop("times"))
        return document


def publishable(
    record: Prepared, phases: Phases, local: LocalStiffness | None, other: LocalStiffness | None
) -> Result:
    """Return the result of a record.

    Parameters
    ----------
    record
        The prepared record.
    phases
        Phases of the record.
    local
        Stiffness and damping in contact; None if there are too few samples.
    other
        Stiffness and damping in contact with another smoothing bandwidth; None to omit this
        comparison.
    """
    against = reasons_before_fit(record, phases)
    if local is None and not against:
        against.append("too few samples in contact: expected a longer record or a faster rate")
    if local is None or against:
        return Result(reasons=tuple(against))
    second = other or local
    half_k = LEVEL_95 * math.hypot(local.k_std, 0.5 * (local.k - second.k))
    half_b = LEVEL_95 * math.hypot(local.b_std, 0.5 * (local.b - second.b))
    change = change_over_cycles(record, phases)
    against = reasons_after_fit(local, half_k, phases)
    if change and change.with_frequency:
        against = [change.text]
    if against:
        return Result(reasons=tuple(against))
    inside = phases.usable
    lowest = float(record.x[inside].min())
    point, level = phases.contact_point, phases.free_force
    if local.baseline_size > 0.0:  # contact point and level change with the baseline
        point = level = None
    zero = point.value if point else lowest
    force = local.best.force
    depth = local.best.position - zero
    secant = secant_change = None
    if level is not None and depth > 0.0:
        secant = (force - level) / depth
        secant_change = DATUM_ERROR / depth
    return Result(
        local.k,
        local.k - half_k,
        local.k + half_k,
        local.b,
        local.b - half_b,
        local.b + half_b,
        True,
        tuple(remarks(record, phases, local, half_b, change)),
        force if level is None else force - level,
        depth,
        secant,
        secant_change,
        merged(local.best.times),
        "contact point" if point else "lowest position",
        local.frequency if math.isfinite(local.frequency) else None,
    )


def reasons_before_fit(record: Prepared, phases: Phases) -> list[str]:
    """Return the reasons why no stiffness can be fitted to the record; empty if there are none."""
    if reason := unsuited(record, phases):
        return [reason]
    found = []
    if phases.saturated:
        found.append(
            "the force rests at its highest value while the position moves: the sensor is "
            "saturated, or the specimen slips or yields"
        )
    if record.band.coherence == 0.0:
        found.append("the force does not follow the displacement: no contact")
    elif not phases.usable.any():
        found.append("contact is too short for the smoothing: expected longer contact")
    else:
        inside = record.x[phases.usable]
        travel = float(np.ptp(inside))
        if travel < 2.5 * MOTION * record.x_noise:
            found.append(
                too_few_per_cycle(record)
                or f"in contact the position moves by {travel * 1e6:.3g} um, too little for its "
                f"noise of {record.x_noise * 1e6:.2g} um: a rigid stop, or a position sensor that "
                "does not resolve the indentation"
            )
        elif phases.free_force is not None and travel < DEPTH * float(np.ptp(record.x)):
            found.append(
                f"in contact the position moves by {travel * 1e6:.3g} um of "
                f"{np.ptp(record.x) * 1e6:.4g} um: a rigid stop"
            )
    return found


def reasons_after_fit(local: LocalStiffness, half_k: float, phases: Phases) -> list[str]:
    """Return the reasons why a fitted stiffness is not reported; empty if there are none.

    Parameters
    ----------
    local
        The fitted stiffness and damping.
    half_k
        Half width of the 95 % interval of k [N/m].
    phases
        Phases of the record.
    """
    if local.k + half_k < 0.0:
        return [
            f"the stiffness is negative ({local.k:.0f} N/m): check that force and position are "
            "both positive in compression (see --invert), and that inertia does not dominate"
        ]
    structural = phases.free_force is not None or local.best.degree >= STRUCTURAL
    if structural and local.r2 < EXPLAINED:
        return [
            f"in contact the position explains {local.r2:.0%} of the force variance: a rigid stop, "
            "slip, or a specimen that changes"
        ]
    if half_k > WIDEST * abs(local.k) or local.k < 0.0:
        where = "" if phases.free_force is None else " in contact"
        why = "no contact, noise, or too little motion"
        if local.r2 > POOR and local.best.degree > 1:
            why = "it depends on depth or time; `phases` in --json has the slope of each loading"
        return [
            f"the force does not follow the displacement well enough{where}: stiffness "
            f"{local.k:.0f} \u00b1 {half_k:.0f} N/m ({why})"
        ]
    return []


def remarks(
    record: Prepared, phases: Phases, local: LocalStiffness, half_b: float, change: Change | None
) -> list[str]:
    """Return the remarks that are reported with an identifiable stiffness.

    Parameters
    ----------
    record, phases, local
        The prepared record, its phases, and the fitted stiffness and damping.
    half_b
        Half width of the 95 % interval of b [N s/m].
    change
        Change of the stiffness over the cycles; None for none.
    """
    found = []
    best, plain = local.best, local.kelvin_voigt
    size = float(np.ptp(record.f[phases.usable]))
    slight = plain.rms < SLIGHT * 0.35 * size
    if change:
        found.append(change.text)
    elif (
        best is not plain
        and not slight
        and best.bic < plain.bic - 10.0
        and plain.rms > 1.05 * best.rms
    ):
        what = [f"the stiffness depends on depth (degree {best.degree})"] if best.degree > 1 else []
        if best.times:
            what.append(
                f"force relaxes ({', '.join(f'{tau:.2g} s' for tau in merged(best.times))})"
            )
        found.append(
            f"Kelvin-Voigt is insufficient: {' and '.join(what)}; residual {plain.rms:.2g} N, "
            f"and {best.rms:.2g} N with that in the model"
        )
    found += contact_remarks(record, local)
    if local.r2 < POOR:
        found.append(
            f"bad fit: {1.0 - local.r2:.0%} of the force variance in contact is not explained"
        )
    if local.baseline_size > SMALL_BASELINE * size:
        found.append(
            f"a baseline of {local.baseline_size:.3g} N peak to peak below "
            f"{0.6 * record.band.low:.2g} Hz is removed: drift, or relaxation"
        )
    if local.samples < FEWEST_INDEPENDENT:
        found.append(
            f"few samples: {local.samples} independent samples in contact, and the intervals need "
            f"{FEWEST_INDEPENDENT}: expected a longer record or a faster rate"
        )
    if half_b > abs(local.b):
        found.append("damping is not resolved: its interval contains zero")
    elif local.b < 0.0:
        found.append(
            "damping is negative: the force lags behind the position (see --force-lag and teleop "
            "lag), or motion is lost between the position sensor and the tip, which biases k too"
        )
    return found
