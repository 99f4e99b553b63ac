"""Find the points at which a motion reverses, and the frequency of a cyclic motion."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from estimation.arrays import Floats
from teleop.evaluation.batch.thresholds import (
    FEWEST_INNER_STROKES,
    LEAST_FOLLOWED_SLOPE,
    LEAST_STROKE,
    LEAST_WHOLE_STROKE,
    REGULAR_CYCLE,
)


def least_stroke(x: Floats) -> float:
    """Return the smallest travel between two reversals that counts as a stroke of a cycle [m].

    The result is the standard deviation of the position, but at least the fraction `LEAST_STROKE`
    of the range of the position. This lower limit is used for a record that is mostly at rest,
    because its standard deviation is too small.
    """
    low, high = np.percentile(x, [1.0, 99.0])
    return max(float(np.std(x)), LEAST_STROKE * float(high - low))


def cycle_frequency(x: Floats, period: float) -> float | None:
    """Return the mean frequency of the cycles of a motion [Hz].

    An inward stroke is the motion from one reversal to the next while the position increases. A
    cycle lasts from the middle of one inward stroke to the middle of the next. A cycle that is much
    longer than the typical cycle contains a rest, and is not used. If there is only one cycle, a
    rest in it is not detected. The result is None if the motion has fewer than two inward strokes.
    """
    turns = turning_points(x, least_stroke(x))[1:-1]
    inward = [(start, end) for start, end in pairwise(turns) if x[end] > x[start]]
    if not inward:
        return None
    least = LEAST_WHOLE_STROKE * float(np.median([x[end] - x[start] for start, end in inward]))
    middles = [middle_of_stroke(x, *one) for one in inward if x[one[1]] - x[one[0]] > least]
    if len(middles) > FEWEST_INNER_STROKES:
        middles = middles[1:-1]
    cycles = np.diff(middles)
    if not len(cycles):
        return None
    typical = float(np.percentile(cycles, 50.0, method="lower"))
    regular = cycles[np.abs(cycles - typical) < REGULAR_CYCLE * typical]
    return 1.0 / (float(np.mean(regular)) * period)


def middle_of_stroke(x: Floats, start: int, end: int) -> float:
    """Return the place in a record at which the position reaches the middle of a stroke.

    The place is an index in `x` that is interpolated linearly between two samples. The stroke is
    inward, which means that the position increases.
    """
    level = 0.5 * (x[start] + x[end])
    i = start + int(np.argmax(x[start : end + 1] >= level))
    return float(i - (x[i] - level) / (x[i] - x[i - 1]))


def turning_points(x: Floats, least: float) -> list[int]:
    """Return the indices of the samples at which a motion reverses.

    Two indices are added to the list: 0 at its beginning, and n at its end.
    """
    turns = [0]
    highest = lowest = 0
    direction = 0
    values = x.tolist()
    for i, value in enumerate(values):
        if value > values[highest]:
            highest = i
        if value < values[lowest]:
            lowest = i
        if direction >= 0 and values[highest] - value > least:
            if direction > 0 or highest > 0:
                turns.append(highest)
            direction, lowest = -1, i
            highest = i
        elif direction <= 0 and value - values[lowest] > least:
            if direction < 0 or lowest > 0:
                turns.append(lowest)
            direction, highest = 1, i
            lowest = i
    if turns[-1] < len(x):
        turns.append(len(x))
    return turns


def without_lost_motion(turns: list[int], x: Floats, f: Floats) -> list[int]:
    """Return the turning points that are not caused by lost motion (backlash).

    If there is lost motion between the position sensor and the tip, a small oscillation of the
    drive moves the sensor, but not the tip. Then the position changes between two successive
    turning points, but the force hardly changes. These two turning points are removed.
    """
    slope = LEAST_FOLLOWED_SLOPE * float(np.ptp(f)) / max(float(np.ptp(x)), 1e-300)
    found = np.array(turns)
    while len(found) > 3:
        at = np.minimum(found, len(x) - 1)
        travel = np.abs(np.diff(x[at]))
        smallest = (travel[1:-1] <= travel[:-2]) & (travel[1:-1] < travel[2:])
        lost = np.abs(np.diff(f[at])) < slope * travel
        first = np.flatnonzero(smallest & lost[1:-1]) + 1
        if not len(first):
            break
        found = np.delete(found, [*first, *(first + 1)])
    return [int(turn) for turn in found]
