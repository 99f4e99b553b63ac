"""The relaxing part of an elastic force, computed by a recursion.

`scipy.signal.lfilter` gives the same numbers, but importing `scipy.signal` takes longer than the
evaluation of a short record.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from estimation.compiled import Floats


def relaxing_part(y: Floats, starts: Sequence[int], period: float, tau: float) -> Floats:
    """Solve z' = y' - z / tau, with z = 0 at the start of each piece; return z, shape (n,).

    Parameters
    ----------
    y
        Elastic force at a constant sample period, shape (n,).
    starts
        Index of the first sample of each piece of the record.
    period
        Sample period [s].
    tau
        Time constant [s].
    """
    decay = math.exp(-period / tau)
    gain = tau / period * (1.0 - decay)
    values: list[float] = []
    for piece in np.split(y, starts[1:]):
        scaled = (gain * (piece - piece[0])).tolist()
        z = last = 0.0
        for present in scaled:
            z = present + (decay * z - last)
            values.append(z)
            last = present
    return np.array(values)
