"""Find the drift of the force in free motion, and remove it from the record.

Out of contact, the force of a sensor without drift has the same value each time. The record is
divided at the deepest positions, so that each part contains at most one time out of contact, whose
force is compared with the lowest force of this part only (`free_and_saturated`).

The forces of these times are fitted by a polynomial in time, of the highest degree that is
significant. If no polynomial describes them within their errors, as after the zero of the sensor
has jumped, the drift is interpolated between them (`scipy.interpolate.PchipInterpolator`). It is
not, if one of these times may be a part of the contact: its positions are deeper than the contact
point of another one.

A body that relaxes, softens or moves does not change the force out of contact. A drift that is not
removed looks like each of these, because it changes the force in contact from press to press.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.autocorrelation import effective_samples
from teleop.evaluation.batch.contact_phases import free_and_saturated, guard_of, level_width
from teleop.evaluation.batch.masks import eroded
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.strokes import least_stroke, turning_points
from teleop.evaluation.batch.thresholds import (
    DRIFT_ERRORS,
    FEWEST_FREE_SAMPLES,
    FEWEST_SPARE_TIMES,
    HIGHEST_DRIFT_DEGREE,
    LARGEST_DRIFT_MISFIT,
    LARGEST_PART_DRIFT,
    LEAST_FREE_DRIFT,
    LOWEST_FORCES,
    LOWEST_POSITIONS,
    MOST_FREE_PARTS,
    ROUGHEST_DRIFTS,
    SHORTEST_FREE_SPAN,
    TERM_ERRORS,
)
from teleop.evaluation.reading.signals import Signals


class ForceDrift(NamedTuple):
    """A drift of the force."""

    t: Floats
    """Times [s], shape (n,)."""
    force: Floats
    """Force out of contact at these times, minus its mean [N], shape (n,)."""
    share: float
    """Largest minus smallest force out of contact, as a fraction of the range of the force."""

    @property
    def change(self) -> float:
        """Largest minus smallest force out of contact [N]."""
        return float(np.ptp(self.force))

    @property
    def text(self) -> str:
        """Sentence for the user that describes the drift."""
        return (
            f"the force drifts: out of contact it changes by {self.change:.3g} N over the record "
            f"({self.share:.1%} of the range of the force), which is removed"
        )

    def at(self, t: Floats) -> Floats:
        """Return the drift at any times [N]."""
        return np.asarray(np.interp(t, self.t, self.force))

    def removed(self, signals: Signals) -> Signals:
        """Return the signals with the force without the drift."""
        f = signals.f - self.at(signals.t)
        return signals._replace(f=f, measured_force_step=signals.force_step)


class FreeTime(NamedTuple):
    """A part of a time out of contact."""

    t: float
    """Mean time [s]."""
    force: float
    """Mean force [N]."""
    error: float
    """Standard deviation of the mean force, from the scatter of the force [N]."""
    lowest: float
    """Lowest position of the whole time [m]."""
    highest: float
    """Highest position of the whole time [m]."""
    number: float
    """Number of the whole time."""


def find_drift(record: SmoothedRecord) -> ForceDrift | None:
    """Return the drift of the force out of contact; None if it is not significant.

    The search is repeated without the drift that was found: a time out of contact with a large
    drift is only found then.
    """
    free = times_out_of_contact(record)
    drift = drift_of(record, free)
    if drift is None:
        return None
    again = times_out_of_contact(replace(record, f=record.f - drift.at(record.t)))
    if better := drift_of(record, again):
        free, drift = again, better
    whole = float(record.t[-1] - record.t[0])
    return drift if free[-1].t - free[0].t > SHORTEST_FREE_SPAN * whole else None


def times_out_of_contact(record: SmoothedRecord) -> list[FreeTime]:
    """Return the parts of the times out of contact, in the order of time.

    Between two deepest positions, there is at most one such time. The drift in it is estimated at
    the lowest positions, because the force must be constant.
    """
    x, f = record.x, record.f.copy()
    turns = turning_points(x, least_stroke(x))
    deepest = [turn for before, turn in pairwise(turns[:-1]) if x[turn] > x[before]]
    bounds = [0, *deepest, len(x)]
    floor = np.empty_like(f)
    low_force, high = record.force_range
    for start, end in pairwise(bounds):
        part = slice(start, end)
        low = start + np.flatnonzero(x[part] <= x[part].min() + LOWEST_POSITIONS * np.ptp(x[part]))
        # medians, because the ends may be in contact with a damped body
        (t_before, f_before), (t_after, f_after) = (
            (float(np.median(record.t[half])), float(np.median(f[half])))
            for half in (low[: len(low) // 2 + 1], low[len(low) // 2 :])
        )
        rate = (f_after - f_before) / max(t_after - t_before, record.period)
        # in a part that begins or ends in contact, the lowest positions may be those of contact
        if abs(rate) * np.ptp(record.t[part]) > LARGEST_PART_DRIFT * (high - low_force):
            rate = 0.0
        f[part] -= rate * (record.t[part] - 0.5 * (t_before + t_after))
        floor[part] = np.percentile(f[part], LOWEST_FORCES)
    free, _ = free_and_saturated(replace(record, f=f), x, level_width(record), floor)
    if free is None:
        return []
    apart = eroded(free, guard_of(record))
    shortest = max(FEWEST_FREE_SAMPLES, 2 * guard_of(record))
    found = []
    for number, (start, end) in enumerate(pairwise(bounds)):
        index = start + np.flatnonzero(apart[start:end])
        if len(index) < 2 * FEWEST_FREE_SAMPLES:
            continue
        places = record.x[start:end][free[start:end]]
        count = int(np.clip(len(index) // shortest, 2, MOST_FREE_PARTS))
        for own in np.array_split(index, count):
            force = record.raw_f[own]
            scatter = float(np.std(force)) / math.sqrt(effective_samples(force - force.mean()))
            error = math.hypot(scatter, record.f_rounding)
            mean = float(record.t[own].mean()), float(force.mean())
            found.append(
                FreeTime(*mean, error, float(places.min()), float(places.max()), float(number))
            )
    return found


def drift_of(record: SmoothedRecord, free: list[FreeTime]) -> ForceDrift | None:
    """Return the drift through the times out of contact; None if it is not significant."""
    if len({one.number for one in free}) < 2:
        return None
    t, force, error, lowest, highest, number = np.array(free).T
    numbers = np.unique(number)
    t_means, means = (np.array([one[number == i].mean() for i in numbers]) for one in (t, force))
    times = len(means)
    # slow noise differs between the parts of a time by more than the scatter in them states
    rate = np.gradient(means, t_means)
    rest = force - rate[np.searchsorted(numbers, number)] * t
    apart = np.abs(np.diff(rest))[np.diff(number) == 0.0]
    error = np.maximum(error, max(np.median(error), 1.4826 * np.median(apart) / math.sqrt(2.0)))
    low, high = record.force_range
    scatter = float(np.std(means))
    roughness = float(np.sqrt(np.mean(np.diff(means) ** 2))) / max(scatter, 1e-300)
    if times > 2 and roughness > max(ROUGHEST_DRIFTS):
        return None
    found = best_polynomial(record, t, force, error, number)
    if found is None:
        is_slow = any(
            roughness < roughest and scatter > errors * error[0]
            for roughest, errors in ROUGHEST_DRIFTS.items()
        )
        if times < 3 or not is_slow or lowest.max() > highest.min():
            return None
        # an import of scipy.interpolate takes longer than the evaluation of a short record
        from scipy.interpolate import PchipInterpolator

        found = PchipInterpolator(t, force)(np.clip(record.t, t[0], t[-1]))
    share = float(np.ptp(found)) / (high - low)
    if share < LEAST_FREE_DRIFT:
        return None
    return ForceDrift(record.t, found - found.mean(), share)


def best_polynomial(
    record: SmoothedRecord, t: Floats, force: Floats, error: Floats, number: Floats
) -> Floats | None:
    """Return the polynomial of the highest significant degree at the times of the record [N].

    The result is None if no polynomial is significant, or if none describes the forces [N] at the
    times t [s] within their errors. `number` is the number of the time of each, whose parts are
    not independent if the noise is slow.
    """
    found: Floats | None = None
    start, end = float(record.t[0]), float(record.t[-1])
    since, over_time = (2.0 * (each - start) / (end - start) - 1.0 for each in (t, record.t))
    tolerance = LARGEST_DRIFT_MISFIT * error[0]
    same_time = number[:, None] == np.unique(number)
    times, parts = same_time.shape[1], same_time.sum(axis=0)
    highest = max(1, min(HIGHEST_DRIFT_DEGREE, times - FEWEST_SPARE_TIMES))
    for degree in range(1, highest + 1):
        powers = since[:, None] ** np.arange(degree + 1)
        orthogonal, triangular = np.linalg.qr(powers / error[:, None])
        along = orthogonal.T @ (force / error)
        rest = force / error - orthogonal @ along
        of_parts = float(rest @ rest) / max(len(t) - degree - 1, 1)
        of_times = float(np.sum((rest @ same_time) ** 2 / parts)) / max(times - degree - 1, 1)
        scale = math.sqrt(max(1.0, of_parts, of_times))
        significant = np.linalg.norm(along[1:]) > DRIFT_ERRORS * scale
        if significant and abs(along[-1]) > TERM_ERRORS * scale:
            suits = float(np.sqrt(np.mean((rest * error) ** 2))) < tolerance
            coefficients = np.linalg.solve(triangular, along)
            if suits:
                found = np.asarray(np.polynomial.polynomial.polyval(over_time, coefficients))
    return found
