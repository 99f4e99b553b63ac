"""Find the phases of a palpation: free motion, loading, hold and unloading.

**Contact.** Out of contact, the force is constant while the position changes. In contact, a travel
dx changes the force by about k dx, with the stiffness k. While the force changes by less than a
small value w (`level_width`), the travel in contact is therefore less than about w / k. A part of
the record is free motion if the force stays within w of its lowest value, and the travel is several
times larger than w / k. Travel directly after a reversal is not counted, because lost motion
(backlash) also keeps the force constant there. The method needs no zero of position or force, and
also works if the surface drifts. If there is no free motion, the record is either in contact
throughout or never in contact. It is never in contact if the force does not follow the displacement
(`teleop.evaluation.batch.stiffness_result`). If the force stays near its highest value while the
position changes, the force sensor is saturated, or the specimen slips or yields.

**Phases.** In contact, loading and unloading are the monotone parts between turning points. A
reversal counts as a turning point if two conditions hold: the following motion in the opposite
direction is larger than the fraction `LEAST_TURN` of the whole travel, and the force changes with
this motion. At the beginning and at the end of a monotone part, the position can be nearly
constant. It counts as nearly constant while its distance from the first or the last position of the
part is less than the fraction `LARGEST_HOLD_MOTION` of the travel in the part. The remaining time
of the part is its motion. A time with nearly constant position is a hold if it is longer than
`SHORTEST_HOLD` times the median duration of the motions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.baseline import without_baseline
from estimation.robust_error import robust_fit
from estimation.stiffening import Interval
from teleop.evaluation.batch.contact_point import contact_point
from teleop.evaluation.batch.masks import eroded, hysteresis, runs, without_short
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.strokes import turning_points, without_lost_motion
from teleop.evaluation.batch.thresholds import (
    ADHESION_NOISE,
    CLIPPING_LENGTH,
    CONSTANT_FREE_FORCE,
    FEWEST_CLIPPED,
    FREE_TRAVEL,
    GUARD_WIDTHS,
    JUMP_SLOPE,
    JUMP_WIDTHS,
    LAG_FACTOR,
    LARGEST_FLAT,
    LARGEST_HOLD_MOTION,
    LARGEST_PULL_NOISE,
    LEAST_ADHESION,
    LEAST_FOLLOWED_R2,
    LEAST_FOLLOWED_STIFFNESS,
    LEAST_LEVEL_WIDTH,
    LEAST_MOVED,
    LEAST_PEAK,
    LEAST_TURN,
    LEVEL_WIDTH_NOISE,
    LONG_RECORD_GUARDS,
    MOST_LEVEL_WIDTHS,
    OUT_OF_CONTACT_TRAVEL,
    SHORTEST_CLIPPING,
    SHORTEST_HOLD,
    SLOW_ADHESION_NOISE,
)
from teleop.evaluation.reading.signals import smallest_step


class Phase(NamedTuple):
    """A part of a record with one kind of motion: free motion, loading, hold or unloading."""

    name: str
    """`free`, `loading`, `hold` or `unloading`."""
    start: int
    """Index of the first sample of the phase, in the arrays of the smoothed record."""
    end: int
    """Index of the last sample of the phase, plus 1."""


@dataclass(frozen=True)
class Phases:
    """Times of contact, contact point, and phases of the motion in a record of n samples.

    The phases are free motion, loading, holds and unloading.
    """

    contact: NDArray[np.bool_]
    """Whether there is contact at each sample, shape (n,)."""
    inner: NDArray[np.bool_]
    """True at samples in contact that are farther than the width of the smoothing from any
    beginning or end of contact, shape (n,)."""
    usable: NDArray[np.bool_]
    """True at the samples of `inner` that are also farther than the width of the smoothing from
    gaps and, except in a short record, from the start and the end of the record, shape (n,)."""
    free_force: float | None
    """Median force out of contact [N]; None if the record contains no free motion."""
    free_spread: float
    """Standard deviation of the smoothed force out of contact [N]."""
    free_error: float
    """Standard deviation of the smoothed force out of contact [N]. Samples near contact are not
    used, because the smoothing mixes them with the force in contact."""
    contact_point: Interval | None
    """Position at which contact begins, with its 95 % interval [m]; None if the record has no
    motion from free motion into contact that can be used."""
    saturated: bool
    """Whether the force stays near its highest value while the position changes."""
    phases: tuple[Phase, ...]
    """The phases in the order of time."""


def find_phases(record: SmoothedRecord, with_point: bool = True) -> Phases:
    """Divide a prepared record into phases of motion, and find the contact point.

    The phases are free motion, loading, holds and unloading. The contact point is the position at
    which contact begins. Its search takes most of the time, and is left out if `with_point` is
    False.
    """
    x, f = record.x, record.f
    width = level_width(record)
    free, saturated = free_and_saturated(record, record.palpation, width, record.force_range[0])
    saturated = saturated or clipped(record)
    guard = guard_of(record)
    contact = np.ones(len(x), dtype=np.bool_)
    free_force = point = None
    spread = error = 0.0
    if free is not None:
        free_force, spread = float(np.median(f[free])), float(np.std(f[free]))
        apart = eroded(free, guard)
        error = float(np.std(f[apart])) if apart.any() else spread
        contact = hysteresis(f - free_force, 0.5 * width, width)
        contact = without_short(contact, 2 * guard)
        if with_point:
            point = contact_point(record, contact, free_force, guard)
    inner = contact.copy()
    if free is not None:
        inner = eroded(contact, guard)
        for jump in jumps(record, contact):
            inner[max(0, jump - guard) : jump + guard] = False
    usable = inner.copy()
    ends = [*record.starts, len(usable)]
    for end in ends if usable.sum() > LONG_RECORD_GUARDS * guard * len(ends) else ends[1:-1]:
        usable[max(0, end - guard) : end + guard] = False
    parts = split(record, contact)
    return Phases(contact, inner, usable, free_force, spread, error, point, saturated, parts)


def guard_of(record: SmoothedRecord) -> int:
    """Return the distance from contact up to which the smoothing changes the force [samples]."""
    return max(1, round(GUARD_WIDTHS * record.width / record.period))


def jumps(record: SmoothedRecord, contact: NDArray[np.bool_]) -> list[int]:
    """Return the samples at which the force jumps at the beginning or the end of a contact.

    The force of a damped body is not zero at the beginning of contact. After the smoothing, the
    force rises before it, and is steepest where it jumps.
    """
    reach = round(JUMP_WIDTHS * record.width / record.period)
    found = []
    for start, end in runs(contact):
        begins = (start, 1) if start > 0 else None
        ends = (end - 1, -1) if end < len(contact) else None
        for edge, step in filter(None, (begins, ends)):
            slopes = np.diff(record.f[edge : edge + step * reach : step][: end - start])
            if len(slopes) < reach - 1:
                continue
            steepest = int(np.argmax(slopes))
            if slopes[steepest] > JUMP_SLOPE * max(slopes[-1], 0.0):
                found.append(edge + step * steepest)
    return found


def level_width(record: SmoothedRecord) -> float:
    """Return the difference of force below which the force counts as unchanged [N].

    Contact begins when the force exceeds the force out of contact by more than this difference. It
    is at least one step of a digital force sensor, whose force is constant in the meantime.
    """
    low, high = record.force_range
    noise = LEVEL_WIDTH_NOISE * record.f_noise_smoothed
    return max(noise, LEAST_LEVEL_WIDTH * (high - low), record.f_count)


def split(record: SmoothedRecord, contact: NDArray[np.bool_]) -> tuple[Phase, ...]:
    """Divide a record into phases of motion, and return the phases in the order of time.

    Each part out of contact is one phase with the name `free`. The parts in contact are divided
    into loading, holds and unloading.
    """
    bounds = sorted({0, len(contact), *record.starts, *np.flatnonzero(np.diff(contact) != 0) + 1})
    whole = float(np.ptp(record.palpation))
    found: list[Phase] = []
    parts = []
    for start, end in pairwise(bounds):
        if not contact[start]:
            found.append(Phase("free", int(start), int(end)))
            continue
        x, f = record.palpation[start:end], record.f[start:end]
        turns = without_lost_motion(turning_points(x, LEAST_TURN * whole), x, f)
        parts += [(start + a, start + b) for a, b in pairwise(turns)]
    monotone = [(int(start), int(end)) for start, end in parts]
    cores = []
    for start, end in monotone:
        x = record.x[start:end]
        range_ = max(float(np.ptp(x)), 1e-300)
        moving = np.flatnonzero(
            (np.abs(x - x[0]) > LARGEST_HOLD_MOTION * range_)
            & (np.abs(x - x[-1]) > LARGEST_HOLD_MOTION * range_)
        )
        a, b = (int(moving[0]), int(moving[-1]) + 1) if len(moving) else (0, end - start)
        cores.append((start, start + a, start + b, end))
    typical = float(np.median([b - a for _, a, b, _ in cores])) if cores else 0.0
    for start, a, b, end in cores:
        name = "loading" if record.x[end - 1] > record.x[start] else "unloading"
        a = a if a - start > SHORTEST_HOLD * typical else start
        b = b if end - b > SHORTEST_HOLD * typical else end
        for label, first, last in (("hold", start, a), (name, a, b), ("hold", b, end)):
            if last > first:
                found.append(Phase(label, first, last))
    return tuple(merged(sorted(found, key=lambda phase: phase.start)))


def merged(phases: list[Phase]) -> list[Phase]:
    """Return the phases, with adjacent phases of the same name joined to one phase.

    The parameter `phases` is in the order of time.
    """
    joined: list[Phase] = []
    for phase in phases:
        if joined and joined[-1].name == phase.name and joined[-1].end == phase.start:
            joined[-1] = joined[-1]._replace(end=phase.end)
        else:
            joined.append(phase)
    return joined


def free_and_saturated(
    record: SmoothedRecord, x: Floats, width: float, lowest: float | Floats
) -> tuple[NDArray[np.bool_] | None, bool]:
    """Return a mask of the samples in free motion, and whether the force sensor is saturated.

    In free motion, the force stays within `width` [N] of its minimum while the position changes.
    `lowest` is this minimum [N], or one for each sample, if the force drifts. x is the position of
    the record, with or without its baseline. If
    the sensor is saturated, it stays within `width` of its maximum. Without free motion, the mask
    is None.
    """
    f = record.f
    low, high = record.force_range
    if width > 0.2 * (high - low):
        return None, False

    # A force that lags behind the position by the phase delta stays near its peak while the
    # position moves on. For a sine, the force is within `width` of its peak over the phase `turn`
    # on both sides of it, and the position then travels by ptp(x) sin(delta) turn.
    v = np.gradient(x, record.period)
    elastic = without_baseline(f, record.order)
    b, k, _ = np.linalg.lstsq(np.column_stack([v, x, np.ones(len(x))]), elastic, rcond=None)[0]
    tan_delta = min(1.0, abs(b) * float(np.std(v)) / max(abs(k) * float(np.std(x)), 1e-300))
    turn = float(np.arccos(1.0 - min(1.0, 2.0 * width / (high - low))))
    lag = float(np.ptp(x)) * np.sin(np.arctan(tan_delta)) * turn

    pull = adhesion(record) or 0.0
    fast = np.abs(v) > 0.1 * np.percentile(np.abs(v), 95)
    rate = np.gradient(elastic, record.period)
    margin = round(record.width / record.period)

    def constant(level: NDArray[np.bool_], half: NDArray[np.bool_], top: bool) -> NDArray[np.bool_]:
        """Mask of the runs of `level` in which the position travels too far for contact."""
        found = np.zeros(len(f), dtype=np.bool_)
        # The stiffness next to the level, because the specimen can be much stiffer elsewhere.
        beside = fast & ~level & half
        if beside.sum() < 3:
            beside = fast & ~level
        if beside.sum() < 3:
            return found
        stiffness = float(np.median(rate[beside] / v[beside]))
        least = FREE_TRAVEL * width / max(stiffness, 1e-300)
        for start, end in runs(level):
            # the trough of a force that lags is round, and its peak is not earlier
            is_flat = not top and abs(peak_height(f[start:end])) < LARGEST_FLAT * width
            lags = b > 0.0 if top else not is_flat
            allowed = least + (LAG_FACTOR * lag if lags else 0.0)
            is_peak = top and peak_height(f[start:end]) > LEAST_PEAK * width
            # The level is open on one side. In a peak or trough that is larger than the others, or
            # beside a gap, the force is beyond it, but not constant.
            spread = float(np.ptp(np.percentile(f[start:end], [5.0, 95.0])))
            is_peak = is_peak or spread > MOST_LEVEL_WIDTHS * width + (0.0 if top else pull)
            travel, moved = (continued(one, start, end, top, margin) for one in (x, record.x))
            if is_peak or travel <= allowed or moved <= LEAST_MOVED * allowed:
                continue
            part = slice(start, end)
            found[part] = top or not follows(x[part], v[part], elastic[part], stiffness)
        return found

    middle = 0.5 * (low + high)
    free = constant(f < lowest + pull + width, f < middle, top=False)
    saturated = constant(f > high - width, f > middle, top=True)
    return (free if free.any() else None), bool(saturated.any())


def follows(x: Floats, v: Floats, f: Floats, stiffness: float) -> bool:
    """Return whether a force that seems constant follows position and velocity, as in contact.

    The force of a body with damping is smallest before the reversal, and nearly constant while the
    damping force increases and the elastic force decreases. It is still that of a spring and a
    damper. `stiffness` is that of the specimen at forces near this one [N/m].
    """
    fit = robust_fit(np.column_stack([np.ones(len(x)), v, x]), f)
    explained = float(np.var(fit.residual)) < (1.0 - LEAST_FOLLOWED_R2) * float(np.var(f))
    return explained and bool(fit.theta[2] > LEAST_FOLLOWED_STIFFNESS * stiffness)


def adhesion(record: SmoothedRecord) -> float | None:
    """Return the largest adhesion force [N]; None if there is no adhesion.

    If the specimen adheres to the tip, it pulls the tip during the retraction. The force is then
    lower than the force out of contact, which is constant at the lowest positions.
    """
    x, f = record.x, record.f
    out = f[x <= x.min() + OUT_OF_CONTACT_TRAVEL * float(np.ptp(x))]
    inside = slice(guard_of(record), -guard_of(record))  # at the ends, there is more noise
    lowest, span = float(f[inside].min(initial=np.median(f))), float(np.ptp(f))
    if lowest >= out.min() or float(np.std(out)) > CONSTANT_FREE_FORCE * span:
        return None
    level = float(np.median(out))
    pull = level - lowest
    slow_noise = 1.4826 * float(np.median(np.abs(out - level)))
    noise = max(ADHESION_NOISE * record.f_noise_smoothed, SLOW_ADHESION_NOISE * slow_noise)
    least = max(LEAST_ADHESION * span, noise)
    return pull if pull > least else None


def pull_off_force(record: SmoothedRecord, smoothed: float) -> float:
    """Return the largest adhesion force of the measured force [N].

    `smoothed` is that of the smoothed force [N], which is too small where the tip separates. Here
    only so many samples are averaged that the noise is a small part of the adhesion force.
    """
    noise = record.f_noise / (LARGEST_PULL_NOISE * smoothed)
    width = round(record.width / record.period)
    samples = int(np.clip(math.ceil(noise**2), 1, max(width, 1)))
    mean = np.convolve(record.raw_f, np.full(samples, 1.0 / samples), "valid")
    out = record.raw_f[record.x <= record.x.min() + OUT_OF_CONTACT_TRAVEL * np.ptp(record.x)]
    return float(np.median(out) - mean.min())


def peak_height(f: Floats) -> float:
    """Return a measure of the height of a peak of the force [N].

    The samples are divided into three parts of equal length. The result is the mean of the middle
    part minus the mean of the two outer parts. For a peak that is a parabola, the result is 4/9 of
    its height. For a constant force, the result is nearly zero.
    """
    third = len(f) // 3
    if third == 0:
        return 0.0
    return float(f[third:-third].mean() - np.concatenate([f[:third], f[-third:]]).mean())


def continued(x: Floats, start: int, end: int, inwards: bool, margin: int = 0) -> float:
    """Return how far the motion continues in its direction while the force is constant [m].

    After a reversal of the motion, the force also stays constant for a short travel, because of
    lost motion (backlash) between the position sensor and the tip. This travel, in the opposite
    direction, is not counted. If the constant force is at the start or at the end of the record, a
    reversal cannot be detected. Then the whole travel is counted.
    """
    part = x[start:end] if inwards else -x[start:end]
    if start <= margin or end >= len(x) - margin:
        return float(np.ptp(part))
    return float(part.max() - part[0])


def clipped(record: SmoothedRecord) -> bool:
    """Return whether the force sensor is saturated.

    At many samples, the force of a saturated sensor is exactly equal to its maximum, while the
    position changes. Without saturation, the force can also be constant during a small travel, if
    it changes by less than the resolution of the sensor. Therefore, saturation requires a travel
    that is several times larger (`FREE_TRAVEL`). A logger that holds its samples also repeats other
    large values: the maximum must be repeated for longer.
    """
    f, x = record.raw_f, record.raw_x
    highest = float(f.max())
    begins = np.concatenate([[0], np.flatnonzero(np.diff(f)) + 1])
    value, length = f[begins], np.diff(begins, append=len(f))
    held = length[(value > 0.5 * (highest + f.min())) & (value < highest)]
    usual = float(np.quantile(held, 0.95)) if len(held) else 0.0
    count = smallest_step(f)
    least = FREE_TRAVEL * count * float(np.std(record.palpation)) / max(float(np.std(f)), 1e-300)
    least = max(least, 20.0 * record.x_noise)
    at_rest = 0
    for start, end in runs(f == highest):
        longer = end - start >= max(SHORTEST_CLIPPING, CLIPPING_LENGTH * usual)
        if longer and continued(x, start, end, True) > least:
            around = np.concatenate([f[max(0, 2 * start - end) : start], f[end : 2 * end - start]])
            if len(around) and highest - around.min() > 0.02 * np.ptp(f):
                at_rest += end - start
    return at_rest >= FEWEST_CLIPPED
