"""Detect a drift of the force at rest, and a change of the stiffness from cycle to cycle."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from teleop.evaluation.masks import runs
from teleop.evaluation.phases import Phases
from teleop.evaluation.prepared import Prepared

STILL = 0.02
"""Largest speed at rest, relative to the 95 % quantile of the speed."""
SETTLED = 0.2
"""Part at each end of a rest that is not used, as a fraction of the rest."""
LONG = 0.03
"""Shortest used part of a rest, as a fraction of the record."""
RISE = 0.01
"""Smallest rise of the force at rest that counts as a drift, as a fraction of the force range."""
RISE_NOISE = 6.0
"""Smallest rise of the force that counts as a drift, in standard deviations of the noise of the
smoothed force."""
STIFFEST = 3.0
"""Assumed largest ratio of the stiffness at the depth of a rest to the mean stiffness."""
FEWEST_CYCLES, FEWEST_SAMPLES = 6, 8
"""Smallest number of cycles, and of samples in a cycle, to find a change of the stiffness."""
SMALL = 0.25
"""Least travel of a cycle, relative to the largest travel of a cycle. A smaller cycle is tremor."""
CHANGE = 0.15
"""Smallest relative change of the stiffness that is reported."""
SCATTER = 5.0
"""Smallest change of the stiffness that is reported, in standard errors."""
FREQUENCIES = 1.5
"""Ratio of two frequencies above which a change of the stiffness is attributed to the frequency."""


class Change(NamedTuple):
    """Stiffness and frequency in the first and in the last cycles."""

    k: tuple[float, float]
    """Median stiffness [N/m]."""
    frequency: tuple[float, float]
    """Median frequency of the cycles [Hz]."""

    @property
    def with_frequency(self) -> bool:
        """Whether the frequency changes together with the stiffness."""
        return max(self.frequency) > FREQUENCIES * min(self.frequency)

    @property
    def text(self) -> str:
        """Text that describes the change."""
        (first, last), (begin, end) = self
        if self.with_frequency:
            return (
                f"the stiffness changes with the frequency, from {first:.4g} N/m at {begin:.3g} Hz "
                f"to {last:.4g} N/m at {end:.3g} Hz: expected a recording at one frequency"
            )
        return (
            f"the stiffness changes over the cycles, from {first:.4g} to {last:.4g} N/m (medians "
            "of the first and of the last cycles)"
        )


def rise_at_rest(record: Prepared) -> tuple[float, float] | None:
    """Return the rise of the force at rest [N] and its duration [s]; None if it does not rise.

    If the position is constant after loading, the force of a passive body decreases. A rise of the
    force is therefore a drift. After unloading, the force of a passive body can increase. Rests
    after unloading are therefore ignored. If a baseline is removed from the record, the result is
    None.
    """
    if record.order:
        return None
    span = float(np.ptp(record.f))
    stiffness = STIFFEST * span / max(float(np.ptp(record.x)), 1e-300)
    speed = float(np.percentile(np.abs(record.v), 95))
    moving = np.abs(record.v) > STILL * speed
    for start, end in runs(~moving):
        before = np.flatnonzero(moving[:start])
        if len(before) and record.v[before[-1]] < 0.0:
            continue
        guard = int(SETTLED * (end - start))
        f, x = record.f[start + guard : end - guard], record.x[start + guard : end - guard]
        if len(f) < LONG * len(record.f):
            continue
        edge = max(1, len(f) // 10)
        rise = float(np.median(f[-edge:]) - np.median(f[:edge]))
        noise = RISE_NOISE * record.f_noise_smoothed
        if rise > max(RISE * span, noise, 2.0 * stiffness * float(np.ptp(x))):
            return rise, len(f) * record.period
    return None


def change_over_cycles(record: Prepared, phases: Phases) -> Change | None:
    """Return the change of the stiffness from the first to the last cycles; None for no change.

    The median stiffness of the first cycles is compared with that of the last cycles. The
    difference counts as a change if it is large relative to these medians, and relative to the
    scatter of the stiffness from one cycle to the next. The result is also None if there are too
    few cycles.
    """
    begins = [phase.start for phase in phases.phases if phase.name == "loading"]
    parts = [start + np.flatnonzero(phases.usable[start:end]) for start, end in pairwise(begins)]
    travel = [float(np.ptp(record.x[part])) if len(part) else 0.0 for part in parts]
    smallest = SMALL * max(travel, default=0.0)
    k, seconds = [], []
    for i, (start, end) in enumerate(pairwise(begins)):
        part = parts[i]
        if len(part) >= FEWEST_SAMPLES and travel[i] >= smallest:
            k.append(slope_in_cycle(record, part))
            seconds.append((end - start) * record.period)
    if len(k) < FEWEST_CYCLES:
        return None
    count = max(FEWEST_CYCLES // 2, len(k) // 10)
    slopes = np.array(k)
    first, last = float(np.median(slopes[:count])), float(np.median(slopes[-count:]))
    scatter = 1.4826 * float(np.median(np.abs(np.diff(slopes)))) / np.sqrt(count)
    difference = abs(last - first)
    if difference < CHANGE * min(abs(first), abs(last)) or difference < SCATTER * scatter:
        return None
    return Change(
        (first, last),
        (1.0 / float(np.median(seconds[:count])), 1.0 / float(np.median(seconds[-count:]))),
    )


def slope_in_cycle(record: Prepared, part: NDArray[np.intp]) -> float:
    """Return the slope of force over position in one cycle [N/m], without damping and drift."""
    columns: Floats = np.column_stack(
        [np.ones(len(part)), record.clock[part], record.v[part], record.x[part]]
    )
    columns = columns - columns.mean(axis=0)
    columns[:, 0] = 1.0
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    return float(np.linalg.lstsq(columns / size, record.f[part], rcond=None)[0][3] / size[3])
