"""Find the strokes of a motion: reversals, frequency of the cycles, and motions that never reverse.

Two methods find the band of frequencies in which the force follows the position:

- `estimation.coherent_band` computes the band from spectra (the coherent band). It first removes
  the linear trend of force and position. In a ramp at constant speed, the trend is the whole
  motion, and only noise remains. The coherence is then low at all frequencies, although the force
  follows the position.
- `stroke_band` computes the band from the duration of a motion that never reverses (the stroke
  band). A parabola over the position is fitted to the force, without removal of a trend. The fit
  shows whether the force follows the position.

If the force drifts during a motion that never reverses, the drift cannot be distinguished from the
force of a specimen.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from estimation.arrays import Floats
from estimation.coherent_band import COHERENT, CoherentBand, block_means
from teleop.evaluation.batch.thresholds import (
    FEWEST_INNER_STROKES,
    FREQUENCY_CHANGE,
    LARGEST_BACKWARD_MOTION,
    LEAST_FOLLOWED_SLOPE,
    LEAST_RISE_OF_FORCE,
    LEAST_STROKE,
    LEAST_TRAVEL_NOISE,
    LEAST_WHOLE_STROKE,
    REGULAR_CYCLE,
    STROKE_BAND_END,
    WIDEST_COHERENT_BAND,
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
    cycles = cycle_lengths(x)
    if not len(cycles):
        return None
    typical = float(np.percentile(cycles, 50.0, method="lower"))
    regular = cycles[np.abs(cycles - typical) < REGULAR_CYCLE * typical]
    return 1.0 / (float(np.mean(regular)) * period)


def cycle_lengths(x: Floats) -> Floats:
    """Return the lengths of the cycles of a motion [samples], shape (n,).

    A cycle lasts from the middle of one inward stroke to the middle of the next.
    """
    turns = turning_points(x, least_stroke(x))[1:-1]
    inward = [(start, end) for start, end in pairwise(turns) if x[end] > x[start]]
    if not inward:
        return np.zeros(0)
    least = LEAST_WHOLE_STROKE * float(np.median([x[end] - x[start] for start, end in inward]))
    middles = [middle_of_stroke(x, *one) for one in inward if x[one[1]] - x[one[0]] > least]
    if len(middles) > FEWEST_INNER_STROKES:
        middles = middles[1:-1]
    return np.diff(middles)


def is_sweep(x: Floats) -> bool:
    """Return whether the frequency of a motion varies strongly, as in a chirp.

    It does if the quartiles of the lengths of its cycles differ by more than the factor
    `FREQUENCY_CHANGE`.
    """
    cycles = cycle_lengths(x)
    if not len(cycles):
        return False
    short, long = np.percentile(cycles, [25.0, 75.0])
    return bool(long > FREQUENCY_CHANGE * short)


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


def typical_speed(v: Floats) -> float:
    """Return the typical speed of a motion, in the unit of `v`.

    Half of the distance is travelled above the typical speed, and the other half below it. Rests
    therefore do not change the result. The median of the speed over time is not used, because in a
    record that is mostly at rest, it is only noise.
    """
    speeds = np.sort(np.abs(v))
    distance = np.cumsum(speeds)
    return float(speeds[np.searchsorted(distance, 0.5 * distance[-1])])


BLOCKS = 200
"""Approximate number of blocks into which the samples of a motion are divided. The position is
averaged in each block."""


def block_length(x: Floats) -> int:
    """Return the number of samples per block such that `x` has about `BLOCKS` blocks."""
    return max(1, len(x) // BLOCKS)


def is_single_stroke(x: Floats, noise: float) -> bool:
    """Return whether a motion never reverses, such as a ramp.

    A motion in the opposite direction counts as a reversal if it is larger than
    `LARGEST_BACKWARD_MOTION` times the travel, and clearly larger than the noise. The result is
    also False if the travel is not clearly larger than the noise.
    """
    coarse = block_means(x, block_length(x))
    travel = float(np.ptp(coarse))
    backwards = float(np.max(np.maximum.accumulate(coarse) - coarse))
    forwards = float(np.max(coarse - np.minimum.accumulate(coarse)))
    largest = max(LARGEST_BACKWARD_MOTION * travel, 6.0 * noise)
    return travel > LEAST_TRAVEL_NOISE * noise and min(backwards, forwards) < largest


def stroke_band(x: Floats, f: Floats, period: float, noise: float) -> CoherentBand | None:
    """Return the frequency band of a motion that never reverses, computed from its duration.

    The band is called the stroke band. The result is None if the motion reverses, or if the force
    does not follow the position.
    """
    if not is_single_stroke(x, noise):
        return None
    s = (x - x.mean()) / np.ptp(x)
    powers = s[:, None] ** np.arange(3)
    fitted = powers @ np.linalg.lstsq(powers, f, rcond=None)[0]
    scatter = float(np.std(f - fitted))
    if float(np.ptp(fitted)) < LEAST_RISE_OF_FORCE * scatter:
        return None
    speeds = np.abs(np.diff(block_means(x, block_length(x))))
    seconds = block_length(x) * period * float(np.ptp(x)) / typical_speed(speeds)
    return CoherentBand(
        low=0.5 / seconds,
        centre=0.5 / seconds,
        high=STROKE_BAND_END / seconds,
        coherence=1.0 - scatter**2 / float(np.var(f)),
    )


def combined(band: CoherentBand, stroke: CoherentBand) -> CoherentBand:
    """Choose between two frequency bands of a motion that never reverses, and return the choice.

    The coherent band is chosen if its coherence is at least the first limit in
    `estimation.coherent_band.COHERENT`. If the motion contains a hold or a step, its spectrum is
    wider than the stroke band, and only the coherent band contains this wider spectrum. The upper
    end of the coherent band is limited by `WIDEST_COHERENT_BAND`. If the coherence is lower, the
    stroke band is chosen.
    """
    if band.coherence < COHERENT[0]:
        return stroke
    return band._replace(high=max(band.centre, min(band.high, WIDEST_COHERENT_BAND * stroke.high)))
