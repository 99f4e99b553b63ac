"""Find the frequency band of a motion that never reverses, such as a ramp.

Two methods find the band of frequencies in which the force follows the position:

- `estimation.coherent_band` computes the band from spectra (the coherent band). It first removes
  the linear trend of force and position. In a ramp at constant speed, the trend is the whole
  motion, and only noise remains. The coherence is then low at all frequencies, although the force
  follows the position.
- `stroke_band` computes the band from the duration of the motion (the stroke band). A parabola over
  the position is fitted to the force, without removal of a trend. The fit shows whether the force
  follows the position.

If the force drifts during a motion that never reverses, the drift cannot be distinguished from the
force of a specimen.
"""

from __future__ import annotations

import numpy as np

from estimation.arrays import Floats
from estimation.coherent_band import COHERENT, CoherentBand, block_means
from teleop.evaluation.batch.thresholds import (
    LARGEST_BACKWARD_MOTION,
    LEAST_RISE_OF_FORCE,
    LEAST_TRAVEL_NOISE,
    STROKE_BAND_END,
    WIDEST_COHERENT_BAND,
)


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
