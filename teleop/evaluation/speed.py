"""Typical speed of a motion, which does not depend on the duration of rests in the record."""

from __future__ import annotations

import numpy as np

from estimation.arrays import Floats


def typical_speed(v: Floats) -> float:
    """Return the typical speed of a motion, in the unit of `v`.

    Half of the distance is travelled above the typical speed, and the other half below it. Rests
    therefore do not change the result. The median of the speed over time is not used, because in a
    record that is mostly at rest, it is only noise.

    Parameters
    ----------
    v
        Velocity at samples with a constant sample period, shape (n,).
    """
    speeds = np.sort(np.abs(v))
    distance = np.cumsum(speeds)
    return float(speeds[np.searchsorted(distance, 0.5 * distance[-1])])
