"""One number to publish: stiffness and damping with 95 % intervals, or why there is none.

k is the tangent stiffness at half of the force range, in loading (`local_stiffness`): it depends
neither on a zero of position or force nor on the length of the record. A secant F / x does: it is
reported beside the tangent with its change for a datum that is 0.1 mm off. The interval has the
residual's autocorrelation, the spread between models, and the difference that another bandwidth
makes. Where the data do not support k, k and b are None and the reasons say why.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from estimation.estimator import LEVEL_95
from teleop.evaluation.local_stiffness import LocalStiffness
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared

WIDEST = 0.5
"""Half of the interval of k, as a share of k, from which on k is not identified."""
MOTION = 10.0
"""Least travel in contact, in 2.5 standard deviations of the noise of the position."""
DEPTH = 0.02
"""Least travel in contact, as a share of the travel of the record."""
POOR = 0.9
"""R^2 below which the fit is called bad."""
EXPLAINED = 0.8
"""R^2 below which there is no stiffness, in intermittent contact or with a structural misfit."""
STRUCTURAL = 4
"""Degree of the best polynomial from which on a bad fit is a misfit and not noise."""
SLIGHT = 0.02
"""Residual of Kelvin-Voigt, as a share of the force, below which it is sufficient."""
SMALL_BASELINE = 0.05
"""A baseline below this share of the force range is not reported."""
DATUM_ERROR = 1e-4
"""Error of the datum for which the change of the secant is shown [m]."""


@dataclass(frozen=True)
class Result:
    """The number to publish."""

    k: float | None = None
    """Stiffness [N/m]."""
    k_low: float | None = None
    k_high: float | None = None
    b: float | None = None
    """Damping [N s/m]."""
    b_low: float | None = None
    b_high: float | None = None
    identifiable: bool = False
    reasons: tuple[str, ...] = ()
    """Why there is no number, or what to know of it."""
    force: float | None = None
    """Where the tangent is taken: half of the force range [N]."""
    depth: float | None = None
    """Its position from the contact point, or from the lowest position in contact [m]."""
    secant: float | None = None
    """Force over depth there [N/m]."""
    secant_change: float | None = None
    """Change of the secant for a datum that is 0.1 mm off, as a share."""
    times: tuple[float, ...] = field(default=())
    """Time constants of relaxation in the model that was used [s]."""

    def summary(self) -> dict[str, Any]:
        """Return the result as a document."""
        document = asdict(self)
        document["reasons"] = list(self.reasons)
        document["tangent"] = {
            "force_n": document.pop("force"),
            "depth_m": document.pop("depth"),
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
        Its phases.
    local
        Stiffness and damping of its contact phases; None where there are too few samples.
    other
        The same at another bandwidth.
    """
    against = hindrances(record, phases)
    if local is None and not against:
        against.append("too few samples in contact: expected a longer record or a faster rate")
    if local is None or against:
        return Result(reasons=tuple(against))
    change_k = change_b = 0.0
    if other is not None:
        change_k, change_b = 0.5 * (local.k - other.k), 0.5 * (local.b - other.b)
    half_k = LEVEL_95 * math.hypot(local.k_std, change_k)
    half_b = LEVEL_95 * math.hypot(local.b_std, change_b)
    against = doubts(local, half_k, phases)
    if against:
        return Result(reasons=tuple(against))
    inside = phases.usable
    lowest = float(record.x[inside].min())
    zero = phases.contact_point.value if phases.contact_point else lowest
    level = phases.free_force if phases.free_force is not None else None
    force = local.best.force
    depth = local.best.position - zero
    secant = change = None
    if level is not None and depth > 0.0:
        secant = (force - level) / depth
        change = DATUM_ERROR / depth
    return Result(
        local.k,
        local.k - half_k,
        local.k + half_k,
        local.b,
        local.b - half_b,
        local.b + half_b,
        True,
        tuple(remarks(record, phases, local, half_b)),
        force if level is None else force - level,
        depth,
        secant,
        change,
        local.best.times,
    )


def hindrances(record: Prepared, phases: Phases) -> list[str]:
    """Return why the record supports no stiffness, before any fit."""
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
        travel = float(np.percentile(inside, 90) - np.percentile(inside, 10))
        if travel < 2.5 * MOTION * record.x_noise:
            found.append(
                f"in contact the position moves by {travel * 1e6:.3g} um, too little for its noise "
                f"of {record.x_noise * 1e6:.2g} um: a rigid stop, or a position that does not "
                "resolve the indentation"
            )
        elif phases.free_force is not None and travel < DEPTH * float(np.ptp(record.x)):
            found.append(
                f"in contact the position moves by {travel * 1e6:.3g} um of "
                f"{np.ptp(record.x) * 1e6:.4g} um: a rigid stop"
            )
    return found


def doubts(local: LocalStiffness, half_k: float, phases: Phases) -> list[str]:
    """Return why the fit gives no stiffness."""
    if local.k + half_k < 0.0:
        return [
            f"the stiffness is negative ({local.k:.4g} N/m): is force positive in compression, "
            "as position is, or does inertia dominate?"
        ]
    structural = phases.free_force is not None or local.best.degree >= STRUCTURAL
    if structural and local.r2 < EXPLAINED:
        return [
            f"in contact the position explains {local.r2:.0%} of the force variance: a rigid stop, "
            "slip, or a specimen that changes"
        ]
    if half_k > WIDEST * abs(local.k) or local.k < 0.0:
        where = "" if phases.free_force is None else " in contact"
        return [
            f"the force does not follow the displacement well enough{where}: stiffness "
            f"{local.k:.4g} \u00b1 {half_k:.2g} N/m (no contact, noise, or too little motion)"
        ]
    return []


def remarks(record: Prepared, phases: Phases, local: LocalStiffness, half_b: float) -> list[str]:
    """Return what to know of a result."""
    found = []
    best, plain = local.best, local.kelvin_voigt
    size = float(np.ptp(record.f[phases.usable]))
    slight = plain.rms < SLIGHT * 0.35 * size
    if (
        best is not plain
        and not slight
        and best.bic < plain.bic - 10.0
        and plain.rms > 1.05 * best.rms
    ):
        what = [f"the stiffness depends on depth (degree {best.degree})"] if best.degree > 1 else []
        if best.times:
            what.append(f"force relaxes ({', '.join(f'{tau:.2g} s' for tau in best.times)})")
        found.append(
            f"Kelvin-Voigt is insufficient: {' and '.join(what)}; residual {plain.rms:.2g} N, "
            f"{best.rms:.2g} N with that"
        )
    if local.r2 < POOR:
        found.append(
            f"bad fit: {1.0 - local.r2:.0%} of the force variance in contact is not explained"
        )
    if local.baseline_size > SMALL_BASELINE * size:
        found.append(
            f"drift removed: a baseline of {local.baseline_size:.3g} N peak to peak below "
            f"{0.6 * record.band.low:.2g} Hz"
        )
    if half_b > abs(local.b):
        found.append("damping is not different from zero")
    return found
