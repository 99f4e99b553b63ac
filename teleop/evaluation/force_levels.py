"""Find the parts of a record in which the force stays at its lowest or highest level.

At the lowest level, such a part is free motion. At the highest level, the sensor is saturated, or
the specimen slips or yields (`teleop.evaluation.phases`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.baseline import without_baseline
from estimation.compiled import Floats
from teleop.evaluation.masks import runs
from teleop.evaluation.prepared import Prepared
from teleop.evaluation.smallest_step import smallest_step

TRAVEL = 4.0
"""Smallest travel at one force level that counts as free motion, as a multiple of the travel that
the stiffness permits."""
LAG = 1.5
"""Safety factor on the travel between a peak of the force and the later peak of the position."""
MOVED = 0.5
"""The travel is computed from the position without its baseline. The position with its baseline
must travel at least this fraction of the required travel. Otherwise the tip is at rest, and only
the removed baseline changes."""
PEAKED = 0.3
"""Smallest height (`peak_height`) of a smooth peak of the force, as a fraction of the width of the
level. A force with a smaller height counts as constant."""
SHORTEST, FEWEST = 3, 8
"""Smallest numbers of samples at exactly the highest force that indicate saturation: in one cycle,
and in total."""


def levels(record: Prepared, width: float) -> tuple[NDArray[np.bool_] | None, bool]:
    """Return the samples in free motion, and whether the force sensor is saturated.

    Parameters
    ----------
    record
        The prepared record.
    width
        Width of a force level [N].

    Returns
    -------
    Two values. The first is a mask of the samples in free motion, shape (n,); None if there is no
    free motion. The second is whether the force stays at its highest level while the position
    changes.
    """
    x, f = record.palpation, record.f
    low, high = record.force_range
    if width > 0.2 * (high - low):
        return None, False
    v = np.gradient(x, record.period)
    elastic = without_baseline(f, record.order)
    b, k, _ = np.linalg.lstsq(np.column_stack([v, x, np.ones(len(x))]), elastic, rcond=None)[0]
    loss = min(1.0, abs(b) * float(np.std(v)) / max(abs(k) * float(np.std(x)), 1e-300))
    turn = float(np.arccos(1.0 - min(1.0, 2.0 * width / (high - low))))
    lag = float(np.ptp(x)) * np.sin(np.arctan(loss)) * turn
    fast = np.abs(v) > 0.1 * np.percentile(np.abs(v), 95)
    rate = np.gradient(elastic, record.period)
    margin = round(record.width / record.period)
    free = None
    saturated = False
    for bottom in (True, False):
        level = f < low + width if bottom else f > high - width
        middle = 0.5 * (low + high)
        beside = fast & ~level & ((f < middle) if bottom else (f > middle))
        if beside.sum() < 3:
            beside = fast & ~level
        if beside.sum() < 3:
            continue
        stiffness = float(np.median(rate[beside] / v[beside]))
        allowed = TRAVEL * width / max(stiffness, 1e-300)
        if bottom or b > 0.0:  # the peak of a force that lags is not earlier
            allowed += LAG * lag
        resting = np.zeros(len(f), dtype=np.bool_)
        for start, end in runs(level):
            peak = not bottom and peak_height(f[start:end]) > PEAKED * width
            travel, moved = (
                continued(one, start, end, not bottom, margin) for one in (x, record.x)
            )
            if not peak and travel > allowed and moved > MOVED * allowed:
                resting[start:end] = True
        if resting.any():
            if bottom:
                free = resting
            else:
                saturated = True
    return free, saturated


def peak_height(f: Floats) -> float:
    """Return a measure of the height of a peak of the force [N].

    The samples are divided into three parts of equal length. The result is the mean of the middle
    part minus the mean of the two outer parts. It is 4/9 of the height of a parabola, and nearly
    zero for a constant force.
    """
    third = len(f) // 3
    if third == 0:
        return 0.0
    return float(f[third:-third].mean() - np.concatenate([f[:third], f[-third:]]).mean())


def continued(x: Floats, start: int, end: int, inwards: bool, margin: int = 0) -> float:
    """Return how far the motion continues in its direction while the force stays constant [m].

    If the motion reverses, the force stays constant until the lost motion (backlash) between the
    position sensor and the tip is passed. Such a travel in the opposite direction is not counted.
    At the start and at the end of the record, a reversal cannot be detected. In these two cases,
    the whole travel is counted.

    Parameters
    ----------
    x
        Position [m], shape (n,).
    start, end
        Index of the first sample at the constant force, and index after the last such sample.
    inwards
        True if the force became constant in loading, False if in unloading.
    margin
        Number of samples at each end of the record that count as the end.
    """
    part = x[start:end] if inwards else -x[start:end]
    if start <= margin or end >= len(x) - margin:
        return float(np.ptp(part))
    return float(part.max() - part[0])


def clipped(record: Prepared) -> bool:
    """Return whether the force sensor is saturated.

    A saturated sensor gives exactly the highest force at many samples while the position changes.
    Without saturation, the force can also be constant during a small travel, because it changes by
    less than the resolution of the sensor. Only a travel that is several times larger is counted.
    """
    f, x = record.raw_f, record.raw_x
    count = smallest_step(f)
    least = TRAVEL * count * float(np.std(record.palpation)) / max(float(np.std(f)), 1e-300)
    least = max(least, 20.0 * record.x_noise)
    at_rest = 0
    for start, end in runs(f == f.max()):
        if end - start >= SHORTEST and continued(x, start, end, True) > least:
            around = np.concatenate([f[max(0, 2 * start - end) : start], f[end : 2 * end - start]])
            if len(around) and f.max() - around.min() > 0.02 * np.ptp(f):
                at_rest += end - start
    return at_rest >= FEWEST
