"""Detect a drift of the force at rest, and a change of stiffness or lag from cycle to cycle.

The stiffness of each cycle is the slope of the force against the position. A change anywhere in the
record is found by the cumulative sum of the deviations of these slopes from their mean. For
independent slopes, the range of this sum, divided by the standard deviation of a slope and by the
square root of the number of cycles, has the distribution of the range of a Brownian bridge. The
range is also large if the stiffness changes for a part of the record only. The largest value of the
sum has little power in this case.

References
----------
N. H. Kuiper, "Tests concerning random points on a circle", Indagationes Mathematicae 63, 1960 (the
distribution); A. W. Lo, "Long-term memory in stock market prices", Econometrica 59(5), 1991 (the
test by the range of the cumulative sum).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.quantities import STIFFNESS
from estimation.robust_error import robust_fit
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    CHANGE_ERRORS,
    CHANGE_SCATTER,
    CUMULATIVE_RANGE,
    DEPTH_EXPLAINS,
    DRIFT_NOISE,
    EQUAL_TRAVEL,
    FEWEST_COMPARED_CYCLES,
    FEWEST_CYCLE_SAMPLES,
    FEWEST_DEVIATING_CYCLES,
    FEWEST_ISOLATED_CYCLES,
    FEWEST_LAG_CYCLES,
    FEWEST_SAME_CYCLES,
    FEWEST_TREND_CYCLES,
    FREQUENCY_CHANGE,
    LAG_PERIOD_CHANGE,
    LAG_PROBABILITY,
    LAG_SCATTER,
    LARGEST_GROWTH,
    LEAST_CHANGE,
    LEAST_DRIFT,
    LEAST_PHASE_DRIFT,
    LINEAR_LAG,
    PAIR_CHANGE,
    REST_SPEED,
    SAME_STIFFNESS,
    SAME_TRAVEL,
    SHORTEST_REST,
    SINGLE_SHARE,
    STIFFEST_AT_REST,
    TREMOR_TRAVEL,
    TREND_PROBABILITY,
    UNUSED_REST,
)


class Change(NamedTuple):
    """A change of the stiffness between the cycles of a record."""

    k: tuple[float, float]
    """Median stiffness of the first cycles, and of the last cycles [N/m]."""
    frequency: tuple[float, float]
    """Median frequency of the first cycles, and of the last cycles [Hz]."""
    during: tuple[float, float] | None = None
    """Start and end of the deviating cycles [s], if these are not simply the last ones. The first
    value in `k` and `frequency` is then that of the other cycles."""

    @property
    def with_frequency(self) -> bool:
        """Whether the frequency of the motion also differs between the first and the last cycles.

        The change of the frequency may then be the cause of the change of the stiffness.
        """
        return max(self.frequency) > FREQUENCY_CHANGE * min(self.frequency)

    @property
    def text(self) -> str:
        """Sentence for the user that describes the change of the stiffness."""
        (first, last), (begin, end) = self.k, self.frequency
        start, final = (STIFFNESS.text(k, ".4g") for k in (first, last))
        if self.with_frequency:
            return (
                f"the stiffness changes with the frequency, from {start} at {begin:.3g} Hz "
                f"to {final} at {end:.3g} Hz: expected a recording at one frequency"
            )
        if self.during:
            return (
                f"the stiffness changes over the cycles, from {STIFFNESS.short(first, '.4g')} to "
                f"{final} between {self.during[0]:.3g} and {self.during[1]:.3g} s (medians of the "
                "other cycles and of these cycles)"
            )
        return (
            f"the stiffness changes over the cycles, from "
            f"{STIFFNESS.short(first, '.4g')} to {final} (medians "
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


class Cycles(NamedTuple):
    """Stiffness and damping of each cycle in contact; arrays have shape (n,)."""

    start: Floats
    """Time at which the cycle starts [s]."""
    seconds: Floats
    """Duration of the cycle [s]."""
    k: Floats
    """Stiffness: slope of the force against the position [N/m]."""
    b: Floats
    """Damping: coefficient of the velocity [N s/m]."""
    error: Floats
    """Standard deviation of `k`, from the residual in the cycle [N/m]; infinite if not known."""
    travel: Floats
    """Travel in contact [m]."""
    top: Floats
    """Highest position [m]."""

    def summary(self) -> dict[str, float | int | None]:
        """Return number, median and quartiles of the stiffness of the cycles, for JSON."""
        if not len(self.k):
            return {"count": 0, "k_median": None, "k_low_quartile": None, "k_high_quartile": None}
        low, median, high = (float(k) for k in np.percentile(self.k, [25.0, 50.0, 75.0]))
        return {
            "count": len(self.k),
            "k_median": median,
            "k_low_quartile": low,
            "k_high_quartile": high,
        }


def cycles_of(record: SmoothedRecord, phases: Phases) -> Cycles:
    """Return stiffness and damping of the cycles of a record, without cycles of tremor."""
    begins = [phase.start for phase in phases.phases if phase.name == "loading"]
    parts = [start + np.flatnonzero(phases.usable[start:end]) for start, end in pairwise(begins)]
    travel = [float(np.ptp(record.x[part])) if len(part) else 0.0 for part in parts]
    smallest = TREMOR_TRAVEL * max(travel, default=0.0)
    found = [
        (
            float(record.t[start]),
            (end - start) * record.period,
            *slopes_in_cycle(record, part),
            moved,
            float(record.x[start:end].max()),
        )
        for (start, end), part, moved in zip(pairwise(begins), parts, travel, strict=True)
        if len(part) >= FEWEST_CYCLE_SAMPLES and moved >= smallest
    ]
    return Cycles(*np.array(found, dtype=np.float64).reshape(-1, len(Cycles._fields)).T)


def change_over_cycles(cycles: Cycles) -> Change | None:
    """Return the largest change of the stiffness in a record; None for no change.

    The median stiffness of the first cycles is compared with the median stiffness of the last
    cycles. If they do not differ, the cycles in which the stiffness differs most from the others
    are compared with the others (`deviating_cycles`). The difference of the two medians counts as a
    change if it satisfies two conditions. It is at least the fraction `LEAST_CHANGE` of the smaller
    median. It is also at least `CHANGE_SCATTER` standard errors, which are computed from the
    differences between successive cycles. If there are fewer than `FEWEST_COMPARED_CYCLES` cycles,
    only a linear trend, and cycles that differ from equal ones, are found.
    """
    n = len(cycles.k)
    cycles = cycles._replace(k=at_median_depth(cycles))
    frequency = 1.0 / cycles.seconds
    compared: list[tuple[NDArray[np.bool_], NDArray[np.bool_], tuple[int, int] | None]] = []
    deviation = 0.0
    if n >= FEWEST_COMPARED_CYCLES:
        deviation = 1.4826 * float(np.median(np.abs(np.diff(cycles.k))))
        count = max(FEWEST_COMPARED_CYCLES // 2, n // 10)
        compared.append((np.arange(n) < count, np.arange(n) >= n - count, None))
    isolated = isolated_cycles(cycles)
    found = isolated or (deviating_cycles(cycles.k) if compared else None)
    if found is not None:
        inside = (np.arange(n) >= found[0]) & (np.arange(n) < found[1])
        compared.append((~inside, inside, found))
    for one, two, part in compared:
        first, last = float(np.median(cycles.k[one])), float(np.median(cycles.k[two]))
        difference = abs(last - first)
        scatter = deviation / np.sqrt(min(one.sum(), two.sum()))
        certain = difference >= CHANGE_SCATTER * scatter or (isolated and part)
        if difference < LEAST_CHANGE * min(abs(first), abs(last)) or not certain:
            continue
        during = None
        if part is not None:
            end = part[1] - 1
            during = (float(cycles.start[part[0]]), float(cycles.start[end] + cycles.seconds[end]))
        return Change(
            (first, last),
            (float(np.median(frequency[one])), float(np.median(frequency[two]))),
            during,
        )
    return trend_over_cycles(cycles)


def at_median_depth(cycles: Cycles) -> Floats:
    """Return the stiffness of the cycles without its dependence on their depth, if it has one.

    That of a nonlinear body depends on the highest position. The dependence is a straight line. It
    is ignored if it explains less than `DEPTH_EXPLAINS` of the variance.
    """
    k, top = cycles.k, cycles.top
    if len(k) < FEWEST_COMPARED_CYCLES or float(np.ptp(top)) < EQUAL_TRAVEL * cycles.travel.max():
        return k
    away = top - np.median(top)
    without = k - float(np.polyfit(away, k, 1)[0]) * away
    return without if float(np.var(without)) < (1.0 - DEPTH_EXPLAINS) * float(np.var(k)) else k


def trend_over_cycles(cycles: Cycles) -> Change | None:
    """Return a change of the stiffness from each cycle to the next; None if there is none.

    The stiffness is either proportional to the time, for cycles of equal travel, or it increases,
    or decreases, by more than its errors in all cycles.
    """
    n = len(cycles.k)
    if n < FEWEST_TREND_CYCLES:
        return None
    ends = monotone_change(cycles) or linear_change(cycles)
    if ends is None:
        return None
    halves = 1.0 / cycles.seconds[: n // 2], 1.0 / cycles.seconds[-(n // 2) :]
    begin, end = (float(np.median(half)) for half in halves)
    return Change(ends, (begin, end))


def monotone_change(cycles: Cycles) -> tuple[float, float] | None:
    """Return the first and the last stiffness [N/m] if all steps between have the same sign.

    If each cycle that is stiffer than the one before is also deeper, the result is None: a body
    that stiffens with depth can be the cause. In 140 records of bodies that do not change, three
    had such steps, of together 4.5 % and two errors at most. Softening bodies had 16 % and 30
    errors at least.
    """
    k = cycles.k
    with_depth = is_monotone(cycles.top) and (k[-1] > k[0]) == (cycles.top[-1] > cycles.top[0])
    if not is_monotone(k) or with_depth:
        return None
    first, last = float(k[0]), float(k[-1])
    smaller, error = min(abs(first), abs(last)), float(cycles.error.max())
    certain = abs(last - first) > max(LEAST_CHANGE * smaller, CHANGE_ERRORS * error)
    return (first, last) if certain else None


def is_monotone(values: Floats) -> bool:
    """Return whether all values increase, or all decrease."""
    steps = np.diff(values)
    return bool((steps > 0.0).all() or (steps < 0.0).all())


def linear_change(cycles: Cycles) -> tuple[float, float] | None:
    """Return the ends of a line through the stiffnesses [N/m] if its rise is significant."""
    k, n = cycles.k, len(cycles.k)
    if float(np.ptp(cycles.travel)) > EQUAL_TRAVEL * float(cycles.travel.max()):
        return None
    since = np.linspace(-0.5, 0.5, n)
    rise, mean = (float(one) for one in np.polyfit(since, k, 1))
    rest = k - mean - rise * since
    error = float(np.sqrt(rest @ rest / (n - 2) / (since @ since)))
    first, last = mean - 0.5 * rise, mean + 0.5 * rise
    certain = max(CHANGE_SCATTER, float(stdtrit(n - 2, TREND_PROBABILITY))) * error
    if abs(rise) < max(LEAST_CHANGE * min(abs(first), abs(last)), certain):
        return None
    return first, last


def deviating_cycles(k: Floats) -> tuple[int, int] | None:
    """Return first and last plus 1 of the cycles whose stiffness differs from that of the others.

    The result is None if the range of the cumulative sum is not significant, or if the cycles in
    question, or the others, are fewer than `FEWEST_DEVIATING_CYCLES`.
    """
    n = len(k)
    low, middle, high = np.percentile(k, [10.0, 50.0, 90.0])
    # a single cycle with a wrong slope must not look like a change
    limited = np.clip(k, middle - 2.0 * (middle - low), middle + 2.0 * (high - middle))
    # the median of the differences does not contain the changes themselves
    deviation = 1.4826 * float(np.median(np.abs(np.diff(k)))) / np.sqrt(2.0)
    sums = np.concatenate([[0.0], np.cumsum(limited - limited.mean())])
    start, end = sorted((int(np.argmax(sums)), int(np.argmin(sums))))
    if float(np.ptp(sums)) < CUMULATIVE_RANGE * max(deviation, 1e-300) * np.sqrt(n):
        return None
    inside = end - start
    if min(inside, n - inside) < FEWEST_DEVIATING_CYCLES:
        return None
    if inside > n / 2 and start == 0:
        return end, n
    return start, end


def isolated_cycles(cycles: Cycles) -> tuple[int, int] | None:
    """Return first and last plus 1 of successive cycles that differ from a group of equal cycles.

    In a short record, the differences between successive cycles are too few for a statistic. If
    three cycles or more have nearly the same stiffness, their spread is that of a constant body.
    Two are sufficient if the others differ by much more than the errors from the residuals, and so
    is a single other cycle beside three equal ones in a short record. There, a cycle in which the
    stiffness changes has a large residual, and counts as equal within the error from it.
    """
    if len(cycles.k) < FEWEST_TREND_CYCLES:
        return None
    k, travel = cycles.k, cycles.travel
    short = len(k) < FEWEST_COMPARED_CYCLES
    uncertain = np.minimum(LEVEL_95 * cycles.error, LEAST_CHANGE * np.abs(k)) if short else 0.0
    alike = np.abs(k - k[:, None]) < np.maximum(SAME_STIFFNESS * np.abs(k[:, None]), uncertain)
    group = alike[int(np.argmax(alike.sum(axis=1)))]
    centre = float(np.median(k[group]))
    limit = EQUAL_TRAVEL if short else SAME_TRAVEL
    same_travel = np.abs(travel / np.median(travel[group]) - 1.0) < limit
    best = (0, 0)
    for sign in (-1.0, 1.0):
        apart = same_travel & (sign * (k - centre) > LEAST_CHANGE * abs(centre))
        best = max([best, *runs(apart)], key=lambda run: run[1] - run[0])
    equal, apart_count = int(group.sum()), best[1] - best[0]
    if not apart_count:
        return None
    away = float(np.min(np.abs(k[slice(*best)] - centre)))
    largest = cycles.error.max() if equal < FEWEST_SAME_CYCLES else cycles.error[slice(*best)].max()
    far = away > max(PAIR_CHANGE * abs(centre), CHANGE_ERRORS * float(largest))
    several = apart_count >= FEWEST_ISOLATED_CYCLES
    # fewer cycles on one of the two sides are sufficient if they are far apart
    if equal >= FEWEST_SAME_CYCLES:
        return best if several or (far and apart_count >= SINGLE_SHARE * len(k)) else None
    return best if several and far and equal == 2 else None


class LagDrift(NamedTuple):
    """A lag of the force against the position that changes in proportion to the time."""

    rate: float
    """Change of the lag per time: relative difference of the clocks of the two channels."""
    change: float
    """Change of the lag over the record [s]; positive if the lag grows."""
    phase: float
    """Magnitude of the change of the phase over the record [rad]."""

    @property
    def text(self) -> str:
        """Sentence for the user that describes the drift."""
        return (
            f"the lag of the force changes by {self.change * 1e3:.3g} ms over the record at a "
            f"constant stiffness: the clocks of position and force differ by {abs(self.rate):.2%}, "
            "or samples of one channel are lost"
        )


def drift_of_lag(cycles: Cycles) -> LagDrift | None:
    """Return the drift of the lag between force and position; None if there is no drift.

    A difference of the clocks shifts the phase between force and position in proportion to the
    time, and does not change the magnitude of the complex stiffness. A body that softens or relaxes
    changes this magnitude, or its phase changes mainly at the start.
    """
    inner = slice(1, -1)
    k, b, seconds = cycles.k[inner], cycles.b[inner], cycles.seconds[inner]
    middle = cycles.start[inner] + 0.5 * seconds
    n = len(k)
    if n < FEWEST_LAG_CYCLES or float(k.min()) <= 0.0:
        return None
    third = n // 3
    early, late = (float(np.median(part)) for part in (seconds[:third], seconds[-third:]))
    if max(early, late) > LAG_PERIOD_CHANGE * min(early, late):
        return None
    omega = 2.0 * np.pi / float(np.median(seconds))
    phase = np.arctan2(b * omega, k)
    size = np.log(np.hypot(k, b * omega))
    since = (middle - middle.mean()) / max(float(np.ptp(middle)), 1e-300)
    power = float(since @ since)
    slope, growth = float(since @ phase) / power, float(since @ size) / power
    rest = phase - phase.mean() - slope * since
    error = float(np.sqrt(rest @ rest / (n - 2) / power))
    linear = 1.0 - float(rest @ rest) / max(float(np.sum((phase - phase.mean()) ** 2)), 1e-300)
    scatter = max(LAG_SCATTER, float(stdtrit(n - 2, LAG_PROBABILITY)))
    if (
        abs(slope) < max(LEAST_PHASE_DRIFT, scatter * error)
        or linear < LINEAR_LAG
        or abs(growth) > LARGEST_GROWTH * abs(slope)
    ):
        return None
    change = -slope / omega
    whole = float(cycles.start[-1] + cycles.seconds[-1] - cycles.start[0])
    rate = change / float(np.ptp(middle))
    return LagDrift(rate, rate * whole, abs(rate) * whole * omega)


def slopes_in_cycle(record: SmoothedRecord, part: NDArray[np.intp]) -> tuple[float, float, float]:
    """Return stiffness [N/m] and damping [N s/m] in one cycle, and the error of the stiffness.

    They are the coefficients of the position and of the velocity in a least-squares fit of the
    force. The other regressors are a constant and the time. Drift of the force therefore does not
    change them.
    """
    columns: Floats = np.column_stack(
        [np.ones(len(part)), record.clock[part], record.v[part], record.x[part]]
    )
    columns = columns - columns.mean(axis=0)
    columns[:, 0] = 1.0
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    fit = robust_fit(columns / size, record.f[part])
    error = fit.deviation(np.array([0.0, 0.0, 0.0, 1.0]))
    return float(fit.theta[3] / size[3]), float(fit.theta[2] / size[2]), error / float(size[3])
