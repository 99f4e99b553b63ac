"""Describe the extensions of the best model: for JSON, and as parts of a remark."""

from __future__ import annotations

import math
from typing import Any

from estimation.quantities import DAMPING, STIFFNESS
from teleop.evaluation.batch.candidate import (
    DEPTH_DAMPING,
    FRICTION,
    KNOT,
    MASS,
    Candidate,
    FittedPart,
    Value,
)
from teleop.evaluation.batch.local_stiffness import LocalStiffness
from teleop.evaluation.batch.thresholds import (
    FLAT_LAYER_RATIO,
    LARGEST_LAYER_RATIO,
    LEAST_LAYER_RATIO,
    LEAST_LEVEL_WIDTH,
    MOST_LAYER_DEGREE,
)

NO_PARTS: dict[str, Any] = {
    "layers": None,
    "damping_by_depth": None,
    "loading": None,
    "mass_kg": None,
    "friction_n": None,
}
"""Keys in JSON of the extensions, for a model without extensions."""


def layers(best: Candidate) -> FittedPart | None:
    """Return the knot of the best model if it separates two layers; None otherwise.

    With a polynomial of high degree, the stiffness on the two sides of the knot has no meaning.
    """
    knot = best.part(KNOT)
    if knot is None or best.degree > MOST_LAYER_DEGREE:
        return None
    if free_motion(best):
        return None
    low, high = sorted(one.value for one in knot.values[1:])
    return knot if LEAST_LAYER_RATIO * low < high < LARGEST_LAYER_RATIO * low else None


def free_motion(best: Candidate) -> FittedPart | None:
    """Return the knot of the best model if the force hardly increases before; None otherwise.

    The force then changes by less than that of free motion (`contact_phases.level_width`), or the
    stiffness before the knot is a very small part of that after it. A soft layer of which the
    motion contains a small part only also changes the force little, but its stiffness is not small.
    """
    knot = best.part(KNOT)
    if knot is None or best.degree > MOST_LAYER_DEGREE:
        return None
    before, after = (one.value for one in knot.values[1:])
    softer = after > FLAT_LAYER_RATIO * before
    flat = softer and best.share_before_knot < LEAST_LEVEL_WIDTH
    return knot if flat or after >= LARGEST_LAYER_RATIO * before else None


def described(local: LocalStiffness, zero: float, surface: Value, level: float) -> dict[str, Any]:
    """Return the extensions of the best model for JSON.

    Depths are relative to `zero` [m], that of a layer to `surface`, and forces to `level` [N].
    """
    found: dict[str, Any] = {}
    best, loading = local.best, local.loading
    if loading:
        found["loading"] = {
            "force_n": loading.force - level,
            "depth_m": loading.position - zero,
            "slope_n_per_m": loading.slope.interval,
        }
    if knot := layers(best):
        place, before, after = knot.values
        depth = depth_of(place, surface)
        names = ("depth_m", "k_before", "k_after")
        values = (depth, before, after)
        found["layers"] = {name: v.interval for name, v in zip(names, values, strict=True)}
    if (part := best.part(DEPTH_DAMPING)) and not free_motion(best):
        names = ("lowest", "middle", "highest")
        found["damping_by_depth"] = {
            name: v.interval for name, v in zip(names, part.values, strict=True)
        }
    for kind, key in ((MASS, "mass_kg"), (FRICTION, "friction_n")):
        part = best.part(kind)
        if part and not (kind == FRICTION and local.loss_force is not None):
            found[key] = part.values[0].interval
    return found


def depth_of(place: Value, surface: Value) -> Value:
    """Return the depth of a position below the surface [m]."""
    return Value(place.value - surface.value, math.hypot(place.std, surface.std))


def phrases(local: LocalStiffness, surface: Value, sinusoidal: bool) -> list[str]:
    """Return what the best model contains besides the Kelvin-Voigt model and relaxing parts."""
    found: list[str] = []
    best = local.best
    if knot := free_motion(best):
        rise = 1e3 * (knot.values[0].value - surface.value)
        return [
            f"the force hardly increases up to a depth of {rise:.3g} mm: motion out of contact "
            "that a drift, hum or noise of the force hides, or a very soft layer"
        ]
    if knot := layers(best):
        place, before, after = knot.values
        depth = depth_of(place, surface)
        low, high = (1e3 * depth.interval[end] for end in ("low", "high"))
        found.append(
            f"the stiffness changes at a depth of {1e3 * depth.value:.4g} mm (95 % "
            f"interval {low:.4g} to {high:.4g}): {STIFFNESS.text(before.value, '.4g')} before, "
            f"{STIFFNESS.text(after.value, '.4g')} after"
        )
    elif local.stiffens:
        found.append(f"the stiffness depends on depth (degree {best.degree})")
    if part := best.part(DEPTH_DAMPING):
        low_b, _, high_b = part.values
        least = max(low_b.value, 0.0)  # that of a passive body is not negative
        found.append(
            f"the damping grows with depth, from {DAMPING.text(least, '.3g')} at the lowest "
            f"to {DAMPING.text(high_b.value, '.3g')} at the highest position"
            + (", which a single sine does not distinguish from relaxation" if sinusoidal else "")
        )
    if part := best.part(MASS):
        found.append(f"a mass of {part.values[0].value:.3g} kg moves beyond the force sensor")
    part = best.part(FRICTION)
    if part and local.loss_force is not None:
        found.append(
            f"friction in the specimen, and damping, have a force of {local.loss_force:.3g} N "
            "together, which one speed does not separate"
        )
    elif part:
        found.append(f"friction in the specimen has a force of {part.values[0].value:.3g} N")
    return found
