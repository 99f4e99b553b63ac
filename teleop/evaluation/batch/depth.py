"""Find the position at which the depth is zero, and the elastic force at a position."""

from __future__ import annotations

import math

import numpy as np

from estimation.estimator import LEVEL_95
from teleop.evaluation.batch.candidate import Value
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.extension_texts import layers
from teleop.evaluation.batch.local_stiffness import LocalStiffness
from teleop.evaluation.batch.smoothed_record import SmoothedRecord

NEAR = 0.02
"""Distance of the samples near a position, as a fraction of the travel in contact."""
SOFT_LAYER = (0.4, 1.0)
"""Distances above a knot, as fractions of the distance to the contact point, of the samples that
determine the surface of the layer above. Nearer to both ends, the smoothing changes the force."""


def zero_of_depth(record: SmoothedRecord, phases: Phases, local: LocalStiffness) -> float:
    """Return the position at which the depth is zero [m]: contact point or lowest position.

    If a baseline is removed, the contact point changes with the baseline, and is not used. Without
    free motion, the lowest position is that of the whole record, which a reader finds in the file.
    """
    if phases.contact_point and not local.baseline_size > 0.0:
        return phases.contact_point.value
    x = record.x if phases.free_force is None else record.x[phases.usable]
    return float(x.min())


def surface(record: SmoothedRecord, phases: Phases, local: LocalStiffness) -> Value:
    """Return the position at which the depth of a layer is zero [m], with its error.

    It is the position at which the force above the knot, extrapolated, is that of free motion. The
    contact point is found too late if the soft layer has a small stiffness. If the stiffness above
    the knot is not constant, the interval contains the contact point.
    """
    point, knot = phases.contact_point, layers(local.best)
    zero = zero_of_depth(record, phases, local)
    if point is None or zero != point.value:
        return Value(zero, 0.0)
    if knot and phases.free_force is not None:
        place, before, _ = knot.values
        above = (place.value - record.x) / (place.value - zero)
        part = phases.usable & (above > SOFT_LAYER[0]) & (above < SOFT_LAYER[1])
        if part.any():
            x, elastic = record.x[part], record.f[part] - local.b * record.v[part]
            level = float(np.median(elastic - before.value * (x - place.value)))
            depth = (level - phases.free_force) / before.value
            std = math.hypot(abs(depth) * before.std, phases.free_error) / before.value
            found = place.value - depth
            if local.best.degree > 1:
                std = max(std, abs(found - zero) / LEVEL_95)
            return Value(found, std)
    return Value(zero, 0.5 * (point.high - point.low) / LEVEL_95)


def elastic_force(
    record: SmoothedRecord, phases: Phases, local: LocalStiffness, position: float
) -> float | None:
    """Return the force without the damping force at a position [N]; None without samples there."""
    x = record.x
    near = phases.usable & (np.abs(x - position) < NEAR * float(np.ptp(x[phases.usable])))
    if not near.any():
        return None
    k, v = local.k, record.v[near]
    return float(np.median(record.f[near] - local.b * v - k * (x[near] - position)))
