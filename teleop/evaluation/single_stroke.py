"""Find the frequency band of a motion that never reverses, such as a ramp.

In `coherent_band`, the linear trend of force and position is removed before the spectra are
computed. In a ramp at constant speed, the trend is the whole motion, and only noise remains. The
coherence is then low at all frequencies, although the force follows the position. For a motion that
never reverses, the force is therefore compared with the position itself.

A force that drifts while such a motion is made cannot be distinguished from the force of a
specimen.
"""

from __future__ import annotations

import numpy as np

from estimation.coherent_band import COHERENT, CoherentBand, block_means
from estimation.compiled import Floats
from teleop.evaluation.speed import typical_speed

BLOCKS = 200
"""Approximate number of blocks of samples in which the motion is examined."""
REVERSAL = 0.05
"""Largest motion in the opposite direction, relative to the travel."""
LEAST_TRAVEL = 25.0
"""Least travel, in standard deviations of the noise of the position."""
LEAST_RISE = 4.0
"""Least change of the force, in standard deviations of its scatter about a parabola over the
position."""
HIGHEST = 5.0
"""Upper end of the band, as a multiple of the inverse of the duration of the motion. With this
value, about 80 independent samples are fitted in a stroke that is in contact throughout."""
WIDEST = 3.0
"""Largest upper end of the coherent band, as a multiple of the upper end of the stroke band. The
limit is necessary because the tapers of the coherent band leak a little power from the ends of a
slow stroke to all frequencies."""


def block_length(x: Floats) -> int:
    """Return the number of samples in a block, if x is divided into about `BLOCKS` blocks."""
    return max(1, len(x) // BLOCKS)


def is_single_stroke(x: Floats, noise: float) -> bool:
    """Return whether a motion never reverses.

    Parameters
    ----------
    x
        Position [m], shape (n,).
    noise
        Standard deviation of the noise of the position [m].
    """
    coarse = block_means(x, block_length(x))
    travel = float(np.ptp(coarse))
    backwards = float(np.max(np.maximum.accumulate(coarse) - coarse))
    forwards = float(np.max(coarse - np.minimum.accumulate(coarse)))
    largest = max(REVERSAL * travel, 6.0 * noise)
    return travel > LEAST_TRAVEL * noise and min(backwards, forwards) < largest


def stroke_band(x: Floats, f: Floats, period: float, noise: float) -> CoherentBand | None:
    """Return the frequency band of a motion that never reverses (the stroke band).

    The result is None if the motion reverses, or if the force does not follow the position.

    Parameters
    ----------
    x, f
        Position [m] and force [N] with a constant sample period, each of shape (n,).
    period
        Sample period [s].
    noise
        Standard deviation of the noise of the position [m].
    """
    if not is_single_stroke(x, noise):
        return None
    s = (x - x.mean()) / np.ptp(x)
    powers = s[:, None] ** np.arange(3)
    fitted = powers @ np.linalg.lstsq(powers, f, rcond=None)[0]
    scatter = float(np.std(f - fitted))
    if float(np.ptp(fitted)) < LEAST_RISE * scatter:
        return None
    speeds = np.abs(np.diff(block_means(x, block_length(x))))
    seconds = block_length(x) * period * float(np.ptp(x)) / typical_speed(speeds)
    return CoherentBand(
        low=0.5 / seconds,
        centre=0.5 / seconds,
        high=HIGHEST / seconds,
        coherence=1.0 - scatter**2 / float(np.var(f)),
    )


def combined(band: CoherentBand, stroke: CoherentBand) -> CoherentBand:
    """Return the frequency band that is used for a motion that never reverses.

    If the coherence of the coherent band is significant, the coherent band is used, with an upper
    end that is limited by `WIDEST`. It is preferred because it also contains the wider spectrum of
    a hold or a step within the stroke. Otherwise, the stroke band is used.
    """
    if band.coherence < COHERENT[0]:
        return stroke
    return band._replace(high=max(band.centre, min(band.high, WIDEST * stroke.high)))
