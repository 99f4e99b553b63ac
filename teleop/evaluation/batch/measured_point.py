"""Compare the stated stiffness, and its force and depth, with the single cycles of a record.

If the surface of the specimen moves, or the tip slides, the position does not determine the depth.
A model with a baseline and a polynomial in the position can then describe the force with a wrong
slope. In a single cycle, the surface hardly moves. Therefore the slope of the force in each cycle
is computed at the stated force, in loading, from the model f = P(x) + (b + c x) v + d t with a
polynomial P of degree 3. Such a polynomial describes neither the slopes of two layers nor a
relaxation that is faster than the cycle, nor the force of a mass. Therefore P has the knot of the
model of the record, and the relaxing parts and the force of the mass of this model are subtracted
from the force before the fit. The slope of the relaxing parts in loading is added to that of P.
"""

from __future__ import annotations

import math
import warnings
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.quantities import STIFFNESS
from teleop.evaluation.batch.candidate import KNOT, Candidate
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.local_stiffness import LocalStiffness
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    EXPLAINED_RESIDUAL,
    FEWEST_GAP_LOADINGS,
    FEWEST_SLOPE_CYCLE_SAMPLES,
    FEWEST_SLOPE_CYCLES,
    GAP_NEAR,
    GAP_PARTS,
    GAP_SCATTER,
    GAP_SIDE,
    GAP_SIDE_CHANGE,
    INNER_FORCE,
    LARGEST_DIFFERENCE,
    LARGEST_SLOPE_SCATTER,
    LEAST_GAP_DIP,
    LEAST_SLOPE_DIFFERENCE,
    POINT_DISTANCE,
)
from teleop.evaluation.reason import Reason

SLOPE_SAMPLES, MOVING = 40, 0.1
"""Approximate number of samples in motion that are fitted in a cycle, and fraction of the largest
speed above which the tip is in motion. The samples are smoothed, so that more samples do not make
the slope more accurate; but a hand can hold the tip for most of a cycle."""


LARGEST_LOADING_GAP = 0.2
"""Largest distance of the two samples in loading around a point, as a fraction of the travel."""
GRID = np.linspace(0.0, 1.0, 41)
"""Places in the range of positions at which the elastic force of a cycle is computed."""
NEVER_SINGULAR = 1e-14
"""Relative increase of the diagonal of the normal equations, with which they have a solution if
two regressors are proportional."""


class Point(NamedTuple):
    """Force [N] and position [m] at which the stiffness is stated."""

    force: float
    position: float
    difference: float = 0.0
    """Half width of an interval about k for its differences from the slopes of the cycles there,
    beyond its own interval, and for different forces of the passes at this position [N/m]."""


class Slope(NamedTuple):
    """Slope of the force in a cycle [N/m], at a point of this cycle."""

    k: float
    point: Point


def slopes_of_cycles(
    record: SmoothedRecord, phases: Phases, best: Candidate, force: float | None
) -> list[Slope]:
    """Return the slope of each cycle at a force; cycles that do not contain the force are left out.

    Without a force, each cycle has the slope at the middle of its own force range. `best` is the
    model of the record.
    """
    begins = [phase.start for phase in phases.phases if phase.name == "loading"]
    own = np.zeros(1) if best.is_storage else best.relaxing_force  # k' contains the relaxing parts
    relaxing = np.broadcast_to(own, record.x.shape)
    elastic_force = best.force_without_mass_and_friction(record) - relaxing
    layers = best.part(KNOT)
    knot = layers.values[0].value if layers else math.inf
    # the force at the knot is smoothed as the record is
    beyond = record.smoothed(np.maximum(record.raw_x - knot, 0.0))
    found = []
    for start, end in pairwise(begins):
        part = start + np.flatnonzero(phases.usable[start:end])
        if len(part) < FEWEST_SLOPE_CYCLE_SAMPLES:
            continue
        moving = np.abs(record.v[part]) > MOVING * float(np.abs(record.v[part]).max())
        part = part[:: max(1, int(np.count_nonzero(moving)) // SLOPE_SAMPLES)]
        x, v, f = record.x[part], record.v[part], elastic_force[part]
        travel, speed = float(np.ptp(x)), float(np.abs(v).max())
        if travel == 0.0 or speed == 0.0:
            continue
        s, time = (x - x.mean()) / travel, np.linspace(-1.0, 1.0, len(part))
        columns = [np.ones(len(part)), s, s**2, s**3, v / speed, s * v / speed, time]
        change = (knot - float(x.mean())) / travel
        inside = bool(s.min() < change < s.max())
        if inside:
            columns.append(beyond[part] / travel)
        matrix = np.column_stack(columns)
        normal = matrix.T @ matrix
        normal.flat[:: len(normal) + 1] *= 1.0 + NEVER_SINGULAR
        theta = np.linalg.solve(normal, matrix.T @ f)
        grid = float(s.min()) + GRID * float(np.ptp(s))
        elastic = theta[0] + grid * (theta[1] + grid * (theta[2] + grid * theta[3]))
        stiffer = float(theta[-1]) if inside else 0.0
        elastic = elastic + stiffer * np.maximum(grid - change, 0.0)
        loading = np.flatnonzero(v > 0.0)
        if not len(loading):
            continue
        loading = loading[np.argsort(s[loading])]
        along = np.interp(grid, s[loading], relaxing[part[loading]])
        elastic = elastic + along
        low, high = float(elastic[0]), float(elastic[-1])
        level = 0.5 * (low + high) if force is None else force
        margin = INNER_FORCE * (high - low)
        if not low + margin < level < high - margin:
            continue
        nearest = int(np.argmin(np.abs(elastic - level)))
        # between the places, the position follows from the slope there
        steepness = float(np.gradient(elastic, grid)[nearest])
        half_step = 0.5 * float(grid[1] - grid[0])
        beyond_place = (level - float(elastic[nearest])) / (steepness or math.inf)
        at = float(grid[nearest]) + float(np.clip(beyond_place, -half_step, half_step))
        above = int(np.searchsorted(s[loading], at))
        around = s[loading][max(above - 1, 0) : above + 1]
        if len(around) < 2 or around[1] - around[0] > LARGEST_LOADING_GAP:
            continue
        measured = level + best.b * float(np.interp(at, s[loading], v[loading]))
        slope = float(theta[1] + at * (2.0 * theta[2] + 3.0 * at * theta[3]))
        slope += stiffer if at > change else 0.0
        slope = (slope + float(np.gradient(along, grid)[nearest])) / travel
        found.append(Slope(slope, Point(measured, float(x.mean()) + at * travel)))
    return found


def measured_point(
    record: SmoothedRecord, phases: Phases, local: LocalStiffness, half_k: float
) -> Point | Reason:
    """Return the recorded point at which k is stated, or the reason why k is not reported."""
    stated = Point(local.best.force, local.best.position)
    if record.order == 0:
        # k' of a linear body is the same at all points
        other = stated if local.best.is_storage else not_measured(stated)
        return loading_point(record, phases, local) or other
    slopes = slopes_of_cycles(record, phases, local.best, stated.force)
    elsewhere = len(slopes) < FEWEST_SLOPE_CYCLES
    if elsewhere:
        slopes = slopes_of_cycles(record, phases, local.best, None)
        # the stiffness of a linear body is the same at all points
        if not local.is_linear:
            return not_measured(stated)
        if len(slopes) < FEWEST_SLOPE_CYCLES:
            return stated
    k = np.array([one.k for one in slopes])
    middle = float(np.median(k))
    scatter = 1.4826 * float(np.median(np.abs(k - middle)))
    low, high = np.percentile(k, [25.0, 75.0])
    # half of the interquartile range is 0.67 standard deviations
    if elsewhere and high - low > 1.35 * LARGEST_SLOPE_SCATTER * abs(middle):
        return Reason(
            f"the stiffness is not determined: the slopes of the cycles scatter (quartiles "
            f"{STIFFNESS.short(float(low), '.4g')} and {STIFFNESS.text(float(high), '.4g')}), and "
            f"no cycle contains {stated.force:.3g} N, the middle of the force range of the model. "
            "The surface moves or the tip slides, so that the position does not determine the depth"
        )
    # the median of n values has 1.25 times the standard error of their mean
    half = LEVEL_95 * 1.25 * scatter / math.sqrt(len(k))
    least = max(half_k + half, LEAST_SLOPE_DIFFERENCE * abs(middle))
    difference = abs(local.k - middle)
    if local.best.rms < EXPLAINED_RESIDUAL * record.f_noise_smoothed:
        difference = 0.0  # the model describes all cycles; the cubic of a cycle is not exact
    if difference > max(least, (0.0 if elsewhere else LARGEST_DIFFERENCE) * abs(middle)):
        return Reason(
            f"the stiffness is not determined: the model of the whole record has "
            f"{STIFFNESS.text(local.k, '.4g')} at {stated.force:.3g} N, and the median of the "
            f"cycles is {STIFFNESS.text(middle, '.4g')}. The surface moves or the tip slides, so "
            "that the position does not determine the depth, or the body has another law"
        )
    if elsewhere:
        force, position = np.median([one.point[:2] for one in slopes], axis=0)
        return Point(float(force), float(position))
    points = [one.point for one in slopes]
    nearest = min(points, key=lambda point: abs(point.position - stated.position))
    position, travel = nearest.position, float(np.ptp(record.x[phases.usable]))
    if abs(position - stated.position) < POINT_DISTANCE * travel:
        position = stated.position  # the cubic of a cycle is not exact, and k changes with position
    point = point_of(np.array([one.force for one in points]), position, local)
    beyond = difference + half if difference > least else 0.0
    return point._replace(difference=max(beyond, point.difference))


def point_of(forces: Floats, position: float, local: LocalStiffness) -> Point:
    """Return the point at a position [m], where the passes in loading have these forces [N].

    Passes of different speed have different forces, and k depends on the force.
    """
    spread = LEVEL_95 * float(np.std(forces)) * abs(local.best.stiffening / local.k)
    return Point(float(np.median(forces)), position, spread)


def gap_at(record: SmoothedRecord, phases: Phases, local: LocalStiffness) -> Reason | None:
    """Return the reason that k is stated in a gap, where the force changes less; otherwise None.

    Only a specimen that is in contact throughout moves the tip in a gap. On both sides of a gap,
    the slope of the force is larger, and nearly constant. A specimen that stiffens in both
    directions has no constant slope there.
    """
    if phases.free_force is not None:
        return None
    position = local.best.position
    low, high = (float(one) for one in np.percentile(record.x[phases.usable], [2.0, 98.0]))
    grid = np.linspace(low, high, GAP_PARTS + 1)
    found: dict[str, list[Floats]] = {"loading": [], "unloading": []}
    for phase in phases.phases:
        part = np.arange(phase.start, phase.end)[phases.usable[phase.start : phase.end]]
        if phase.name in found and 2 * len(part) > GAP_PARTS:
            part = part if phase.name == "loading" else part[::-1]
            x = np.maximum.accumulate(record.x[part])
            if x[0] < grid[GAP_SIDE] and x[-1] > grid[-1 - GAP_SIDE]:
                signals = (record.f[part], record.v[part])
                found[phase.name].append(
                    np.array([np.interp(grid, x, one, np.nan, np.nan) for one in signals])
                )
    if min(map(len, found.values())) < FEWEST_GAP_LOADINGS:
        return None
    with warnings.catch_warnings():  # a part that no loading contains has no slope
        warnings.simplefilter("ignore", RuntimeWarning)
        (f, v), (f_back, v_back) = (np.nanmedian(one, axis=0) for one in found.values())
        # the damping need not be known: both directions together give the force without it
        elastic = f - v * (f - f_back) / (v - v_back)
    slopes = np.diff(elastic) / (grid[1] - grid[0])
    places, slopes = (
        (0.5 * (grid[1:] + grid[:-1]))[np.isfinite(slopes)],
        slopes[np.isfinite(slopes)],
    )
    at = int(np.argmin(np.abs(places - position)))
    first = max(at - GAP_NEAR, 0)
    least = first + int(np.argmin(slopes[first : at + GAP_NEAR + 1]))
    sides = []
    for side in (slopes[:least], slopes[:least:-1]):  # from the ends of the travel
        outer = side[: (len(side) + 1) // 2]
        steep = float(np.median(outer)) if len(side) else math.nan
        if np.count_nonzero(np.abs(side - steep) < GAP_SIDE_CHANGE * abs(steep)) < GAP_SIDE:
            return None
        scatter = 1.4826 * float(np.median(np.abs(outer - steep))) / steep
        if not slopes[least] < (1.0 - max(LEAST_GAP_DIP, GAP_SCATTER * scatter)) * steep:
            return None
        sides.append(steep)
    flat = places[slopes < 0.5 * (slopes[least] + min(sides))]
    return Reason(
        f"the stiffness is not determined: it would be stated at {position * 1e3:.4g} mm, and "
        f"between {flat.min() * 1e3:.4g} and {flat.max() * 1e3:.4g} mm, its slope falls to "
        f"{STIFFNESS.text(float(slopes[least]), '.3g')}, and is {STIFFNESS.text(sides[0], '.4g')} "
        f"and {STIFFNESS.text(sides[1], '.4g')} on both sides: a gap (lost motion) between "
        "position sensor and specimen, or a specimen that buckles"
    )


def not_measured(stated: Point) -> Reason:
    """Return the reason that the record does not contain the point at which k would be stated."""
    return Reason(
        f"the stiffness is not determined: the middle of the force range, {stated.force:.3g} N at "
        f"a position of {stated.position * 1e3:.4g} mm, is not a point of the record"
    )


def loading_point(record: SmoothedRecord, phases: Phases, local: LocalStiffness) -> Point | None:
    """Return the point in loading at the position of k; None if the record does not pass near it.

    The force of this point is that of the record. It contains the forces of damping, mass and
    friction, which the force at which the model has k does not contain. If the passes have this
    force at different positions, as on a body that relaxes, k is stated at the nearest of them.
    """
    stated = Point(local.best.force, local.best.position)
    part = phases.usable & (record.v > 0.0)
    if not part.any():
        return stated
    x, f = record.x[part], record.f[part]
    elastic = local.best.force_without_mass_and_friction(record)[part] - local.b * record.v[part]
    noise = 3.0 * record.f_noise_smoothed
    size_x, size_f = (max(float(np.ptp(each)), 1e-300) for each in (x, f))
    away_x = np.abs(x - stated.position) / size_x
    away_f = np.abs(elastic - stated.force)
    distance = np.maximum(away_x, np.maximum(away_f - noise, 0.0) / size_f)
    # the distance to the path, not to its samples, which are far apart in fast motions
    spacing = float(np.max(np.abs(record.v))) * record.period / size_x
    position, change = stated.position, 0.0
    if np.min(distance) >= POINT_DISTANCE + spacing:
        at_force = np.maximum(away_f - noise, 0.0) / size_f < POINT_DISTANCE + spacing
        if not at_force.any():
            return None
        position = float(x[at_force][np.argmin(away_x[at_force])])
        change = abs(local.best.stiffening * (position - stated.position))
        if change > LARGEST_DIFFERENCE * abs(local.k):
            return None
        away_x = np.abs(x - position) / size_x
    near = away_x < POINT_DISTANCE + spacing
    point = point_of(f[near] - local.k * (x[near] - position), position, local)
    return point._replace(difference=math.hypot(point.difference, change))
