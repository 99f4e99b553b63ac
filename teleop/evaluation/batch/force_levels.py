"""Find the parts of a record in which the force is constant although the position changes.

If the force stays near its minimum, such a part is free motion (no contact). If the force stays
near its maximum, the sensor is saturated, or the specimen slips or yields
(`teleop.evaluation.batch.phases`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.baseline import without_baseline
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    FEWEST_CLIPPED,
    FREE_TRAVEL,
    LAG_FACTOR,
    LEAST_MOVED,
    LEAST_PEAK,
    SHORTEST_CLIPPING,
)
from teleop.evaluation.reading.smallest_step import smallest_step


def free_and_saturated(
    record: SmoothedRecord, width: float
) -> tuple[NDArray[np.bool_] | None, bool]:
    """Return a mask of the samples in free motion, and whether the force sensor is saturated.

    In free motion, the force stays within `width` [N] of its minimum while the position changes. If
    the sensor is saturated, it stays within `width` of its maximum. Without free motion, the mask
    is None.
    """
    x, f = record.palpation, record.f
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
        allowed = FREE_TRAVEL * width / max(stiffness, 1e-300)
        if not top or b > 0.0:  # the peak of a force that lags is not earlier
            allowed += LAG_FACTOR * lag
        for start, end in runs(level):
            is_peak = top and peak_height(f[start:end]) > LEAST_PEAK * width
            travel, moved = (continued(one, start, end, top, margin) for one in (x, record.x))
            if not is_peak and travel > allowed and moved > LEAST_MOVED * allowed:
                found[start:end] = True
        return found

    middle = 0.5 * (low + high)
    free = constant(f < low + width, f < middle, top=False)
    saturated = constant(f > high - width, f > middle, top=True)
    return (free if free.any() else None), bool(saturated.any())


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
    that is several times larger (`FREE_TRAVEL`).
    """
    f, x = record.raw_f, record.raw_x
    count = smallest_step(f)
    least = FREE_TRAVEL * count * float(np.std(record.palpation)) / max(float(np.std(f)), 1e-300)
    least = max(least, 20.0 * record.x_noise)
    at_rest = 0
    for start, end in runs(f == f.max()):
        if end - start >= SHORTEST_CLIPPING and continued(x, start, end, True) > least:
            around = np.concatenate([f[max(0, 2 * start - end) : start], f[end : 2 * end - start]])
            if len(around) and f.max() - around.min() > 0.02 * np.ptp(f):
                at_rest += end - start
    return at_rest >= FEWEST_CLIPPED
