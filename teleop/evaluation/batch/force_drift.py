"""Find the drift of the force in free motion, and remove it from the record.

Out of contact, the force of a sensor without drift has the same value each time. The record is
divided at the deepest positions, so that each part contains at most one time out of contact, whose
force is compared with the lowest force of this part only (`free_and_saturated`). The mean forces of
these times are fitted by a polynomial in time. They show a drift if the polynomial changes
significantly, and describes all of them.

A body that relaxes, softens or moves does not change the force out of contact. A drift that is not
removed looks like each of these, because it changes the force in contact from press to press.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from estimation.autocorrelation import effective_samples
from teleop.evaluation.batch.contact_phases import free_and_saturated, guard_of, level_width
from teleop.evaluation.batch.masks import eroded
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.strokes import least_stroke, turning_points
from teleop.evaluation.batch.thresholds import (
    DRIFT_ERRORS,
    FEWEST_FREE_SAMPLES,
    FEWEST_FREE_TIMES,
    FEWEST_SPARE_TIMES,
    LARGEST_DRIFT_MISFIT,
    LEAST_FREE_DRIFT,
    LEAST_TREND,
    LOWEST_FORCES,
    SHORTEST_FREE_SPAN,
    TERM_ERRORS,
)
from teleop.evaluation.reading.signals import Signals


class ForceDrift(NamedTuple):
    """A drift of the force, as a polynomial in time."""

    polynomial: np.polynomial.Polynomial
    """Force out of contact over time [N], minus its mean over the record."""
    change: float
    """Largest minus smallest force out of contact in the record [N]."""
    share: float
    """The same, as a fraction of the range of the force."""

    @property
    def text(self) -> str:
        """Sentence for the user that describes the drift."""
        return (
            f"the force drifts: out of contact it changes by {self.change:.3g} N over the record "
            f"({self.share:.1%} of the range of the force), which is removed"
        )

    def removed(self, signals: Signals) -> Signals:
        """Return the signals with the force without the drift."""
        f = signals.f - self.polynomial(signals.t)
        return signals._replace(f=f, measured_force_step=signals.force_step)


class FreeTime(NamedTuple):
    """A time out of contact."""

    t: float
    """Mean time [s]."""
    force: float
    """Mean force [N]."""
    error: float
    """Standard deviation of the mean force, from the scatter of the force [N]."""


def find_drift(record: SmoothedRecord) -> ForceDrift | None:
    """Return the drift of the force out of contact; None if it is not significant.

    The search is repeated without the drift that was found: a time out of contact with a large
    drift is only found then.
    """
    free = times_out_of_contact(record)
    drift = fitted_drift(record, free)
    if drift is not None:
        f = record.f - drift.polynomial(record.t)
        free = times_out_of_contact(replace(record, f=f))
        drift = fitted_drift(record, free) or drift
    whole = float(record.t[-1] - record.t[0])
    if drift is None or free[-1].t - free[0].t < SHORTEST_FREE_SPAN * whole:
        return None
    return drift


def fitted_drift(record: SmoothedRecord, free: list[FreeTime]) -> ForceDrift | None:
    """Return the polynomial of the highest significant degree; None if there is none."""
    found = None
    for degree, fewest in FEWEST_FREE_TIMES.items():
        if len(free) >= fewest:
            found = polynomial_drift(record, free, degree) or found
    return found


def times_out_of_contact(record: SmoothedRecord) -> list[FreeTime]:
    """Return the times out of contact, in the order of time.

    Between two deepest positions, there is at most one.
    """
    x, f = record.palpation, record.f
    turns = turning_points(x, least_stroke(x))
    deepest = [turn for before, turn in pairwise(turns[:-1]) if x[turn] > x[before]]
    bounds = [0, *deepest, len(x)]
    floor = np.empty_like(f)
    for start, end in pairwise(bounds):
        floor[start:end] = np.percentile(f[start:end], LOWEST_FORCES)
    free, _ = free_and_saturated(record, level_width(record), floor)
    if free is None:
        return []
    free = eroded(free, guard_of(record))
    found = []
    for start, end in pairwise(bounds):
        part = start + np.flatnonzero(free[start:end])
        if len(part) >= FEWEST_FREE_SAMPLES:
            force = record.raw_f[part]
            scatter = float(np.std(force)) / math.sqrt(effective_samples(force - force.mean()))
            error = math.hypot(scatter, record.f_rounding)
            found.append(FreeTime(float(record.t[part].mean()), float(force.mean()), error))
    return found


def polynomial_drift(
    record: SmoothedRecord, free: list[FreeTime], degree: int
) -> ForceDrift | None:
    """Return a drift of a degree; None if it or its term of this degree is not significant.

    The result is also None if the drift is small, or if it does not describe all times out of
    contact: at one of them, there may be contact. For the same reason, a polynomial that few times
    determine must mainly rise, or mainly fall.
    """
    t, force, error = np.array(free).T
    error = np.maximum(error, np.median(error))
    start, end = float(record.t[0]), float(record.t[-1])
    powers = (2.0 * (t - start) / (end - start) - 1.0)[:, None] ** np.arange(degree + 1)
    orthogonal, triangular = np.linalg.qr(powers / error[:, None])
    along = orthogonal.T @ (force / error)
    rest = force / error - orthogonal @ along
    scale = math.sqrt(max(1.0, float(rest @ rest) / max(len(t) - degree - 1, 1)))
    if np.linalg.norm(along[1:]) < DRIFT_ERRORS * scale or abs(along[-1]) < TERM_ERRORS * scale:
        return None
    if (np.abs(rest) * error > LARGEST_DRIFT_MISFIT * level_width(record)).any():
        return None
    coefficients = np.linalg.solve(triangular, along)
    fitted = powers @ coefficients
    few = len(t) < degree + FEWEST_SPARE_TIMES
    if few and abs(fitted[-1] - fitted[0]) < LEAST_TREND * float(np.ptp(fitted)):
        return None
    polynomial = np.polynomial.Polynomial(coefficients, domain=[start, end])
    over_time = polynomial(record.t)
    low, high = record.force_range
    change, share = float(np.ptp(over_time)), float(np.ptp(over_time)) / (high - low)
    if share < LEAST_FREE_DRIFT:
        return None
    return ForceDrift(polynomial - float(over_time.mean()), change, share)
