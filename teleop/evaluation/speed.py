"""Typical speed of a motion, whatever the duration of the rests in the record."""

from __future__ import annotations

import numpy as np

from estimation.compiled import Floats


def typical_speed(v: Floats) -> float:
    """Return the speed above which half of the distance is travelled.

    A percentile of the speed over time is that of the noise if the record is mostly at rest.

    Parameters
    ----------
    v
        Velocity at samples of equal distance in time, shape (n,).
    """
    speeds = np.sort(np.abs(v))
    distance = np.cumsum(speeds)
    return float(speeds[np.searchsorted(distance, 0.5 * distance[-1])])
