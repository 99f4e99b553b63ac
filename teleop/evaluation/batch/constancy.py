"""Detect a drift of the force at rest, and a change of the stiffness from cycle to cycle."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.quantities import STIFFNESS
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    CHANGE_SCATTER,
    DRIFT_NOISE,
    FEWEST_COMPARED_CYCLES,
    FEWEST_CYCLE_SAMPLES,
    FREQUENCY_CHANGE,
    LEAST_CHANGE,
    LEAST_DRIFT,
    REST_SPEED,
    SHORTEST_REST,
    STIFFEST_AT_REST,
    TREMOR_TRAVEL,
    UNUSED_REST,
)


class Change(NamedTuple):
    """A change of the stiffness between the first and the last cycles of a record."""

    k: tuple[float, float]
    """Median stiffness of the first cycles, and of the last cycles [N/m]."""
    frequency: tuple[float, float]
    """Median frequency of the first cycles, and of the last cycles [Hz]."""

    @property
    def with_frequency(self) -> bool:
        """Whether the frequency of the motion also differs between the first and the last cycles.

        The change of the frequency may then be the cause of the change of the stiffness.
        """
        return max(self.frequency) > FREQUENCY_CHANGE * min(self.frequency)

    @property
    def text(self) -> str:
        """Sentence for the user that describes the change of the stiffness."""
        (first, last), (begin, end) = self
        start, final = (STIFFNESS.text(k, ".4g") for k in (first, last))
        if self.with_frequency:
            return (
                f"the stiffness changes with the frequency, from {start} at {begin:.3g} Hz "
                f"to {final} at {end:.3g} Hz: expected a recording at one frequency"
            )
        return (
            f"the stiffness changes over the cycles, from "
            f"{STIFFNESS.shown(first):.4g} to {final} (medians "
            "of the first and of the last cycles)"
        )


def rise_at_rest(record: SmoothedRecord) -> tuple[float, float] | None:
    """Return the rise of the force in a rest [N] and its duration [s]; None if there is no rise.

    In a rest, the position is constant. After loading, the force of a passive body then decreases.
    A rise of the force is therefore a drift. After unloading, the force of a passive body can
    increase. Rests after unloading are therefore ignored. The result is also None if the drift of
    the force is estimated by a baseline (`record.order` is positive).
    """
    if record.order:
        return None
    span = float(np.ptp(record.f))
    stiffness = STIFFEST_AT_REST * span / max(float(np.ptp(record.x)), 1e-300)
    speed = float(np.percentile(np.abs(record.v), 95))
    moving = np.abs(record.v) > REST_SPEED * speed
    for start, end in runs(~moving):
        before = np.flatnonzero(moving[:start])
        if len(before) and record.v[before[-1]] < 0.0:
            continue
        guard = int(UNUSED_REST * (end - start))
        f, x = record.f[start + guard : end - guard], record.x[start + guard : end - guard]
        if len(f) < SHORTEST_REST * len(record.f):
            continue
        edge = max(1, len(f) // 10)
        rise = float(np.median(f[-edge:]) - np.median(f[:edge]))
        noise = DRIFT_NOISE * record.f_noise_smoothed
        if rise > max(LEAST_DRIFT * span, noise, 2.0 * stiffness * float(np.ptp(x))):
            return rise, len(f) * record.period
    return None


def change_over_cycles(record: SmoothedRecord, phases: Phases) -> Change | None:
    """Return the change of the stiffness from the first to the last cycles; None for no change.

    The median stiffness of the first cycles is compared with the median stiffness of the last
    cycles. The difference of the two medians counts as a change if it satisfies two conditions. It
    is at least the fraction `LEAST_CHANGE` of the smaller median. It is also at least
    `CHANGE_SCATTER` standard errors, which are computed from the differences between successive
    cycles. The result is also None if there are fewer than `FEWEST_COMPARED_CYCLES` cycles.
    """
    begins = [phase.start for phase in phases.phases if phase.name == "loading"]
    parts = [start + np.flatnonzero(phases.usable[start:end]) for start, end in pairwise(begins)]
    travel = [float(np.ptp(record.x[part])) if len(part) else 0.0 for part in parts]
    smallest = TREMOR_TRAVEL * max(travel, default=0.0)
    k, seconds = [], []
    for i, (start, end) in enumerate(pairwise(begins)):
        part = parts[i]
        if len(part) >= FEWEST_CYCLE_SAMPLES and travel[i] >= smallest:
            k.append(slope_in_cycle(record, part))
            seconds.append((end - start) * record.period)
    if len(k) < FEWEST_COMPARED_CYCLES:
        return None
    count = max(FEWEST_COMPARED_CYCLES // 2, len(k) // 10)
    slopes = np.array(k)
    first, last = float(np.median(slopes[:count])), float(np.median(slopes[-count:]))
    scatter = 1.4826 * float(np.median(np.abs(np.diff(slopes)))) / np.sqrt(count)
    difference = abs(last - first)
    if (
        difference < LEAST_CHANGE * min(abs(first), abs(last))
        or difference < CHANGE_SCATTER * scatter
    ):
        return None
    return Change(
        (first, last),
        (1.0 / float(np.median(seconds[:count])), 1.0 / float(np.median(seconds[-count:]))),
    )


def slope_in_cycle(record: SmoothedRecord, part: NDArray[np.intp]) -> float:
    """Return the stiffness in one cycle [N/m]: the slope of the force against the position.

    The slope is the coefficient of the position in a least-squares fit of the force. The other
    regressors are a constant, the velocity and the time. Damping and drift of the force therefore
    do not change the slope.
    """
    columns: Floats = np.column_stack(
        [np.ones(len(part)), record.clock[part], record.v[part], record.x[part]]
    )
    columns = columns - columns.mean(axis=0)
    columns[:, 0] = 1.0
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    return float(np.linalg.lstsq(columns / size, record.f[part], rcond=None)[0][3] / size[3])
