"""The smallest step of a channel: one count of an encoder or a converter."""

from __future__ import annotations

import numpy as np

from estimation.compiled import Floats

ROUNDING = 1e-12
"""Steps smaller than this share of the largest value are rounding errors."""


def smallest_step(values: Floats) -> float:
    """Return the smallest change between successive samples; 0 if there is none.

    Parameters
    ----------
    values
        Samples of one channel, shape (n,).
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > ROUNDING * float(np.max(np.abs(values), initial=0.0))]
    return float(steps.min()) if len(steps) else 0.0
