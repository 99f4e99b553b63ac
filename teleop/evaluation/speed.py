"""Typical speed of a motion, whatever the duration of the rests in the record."""

from __future__ import annotations

import numpy as np

from estimation.compiled import Floats


def typical_speed(v: Floats) -> float:
    """Return the speed above which half of the distance is travelled.

    This speed is used instead of a percentile over time: in a record that is mostly at rest, such a
    percentile is the speed of the noise.

    Parameters
    ----------
    v
        Velocity at samples of equal distance in time, shape (n,).
    """
    speeds = np.sort(np.abs(v))
    distance = np.cumsum(speeds)
    return float(speeds[np.searchsorted(distance, 0.5 * distance[-1])])
