"""Compute the effect of the rounding of measured values on fitted parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats


def levels(values: Floats, count: float) -> NDArray[np.intp] | None:
    """Return the level (digital value) of each measured value, as a number from 0, shape (n,).

    Values have the same level if they are equal after rounding to multiples of `count`.

    Parameters
    ----------
    values
        Measured values, shape (n,).
    count
        Resolution (smallest step) of the measured values, in their unit. If it is 0, the values are
        not rounded, and the result is None.
    """
    if count == 0.0:
        return None
    return np.unique(np.round(values / count), return_inverse=True)[1]


def summed_by_level(sensitivity: Floats, level: NDArray[np.intp] | None) -> Floats:
    """Return the sensitivity of fitted parameters to the rounding of measured values.

    The result, multiplied by the standard deviation of the rounding error, is the standard
    deviation of each parameter. All samples with the same rounded value have the same rounding
    error. Their derivatives are therefore added. This gives one sum for each rounded value. The
    errors of different rounded values are independent. The result is therefore the root of the sum
    of the squares of these sums.

    Parameters
    ----------
    sensitivity
        Derivative of m parameters with respect to each of n values, shape (m, n).
    level
        Number of the rounded value of each measured value, shape (n,), from `levels`. If it is
        None, the values are not rounded, and the result is 0.

    Returns
    -------
    Array of shape (m,).
    """
    if level is None:
        return np.zeros(len(sensitivity))
    sums = np.array([np.bincount(level, row) for row in sensitivity])
    return np.asarray(np.sqrt(np.sum(sums**2, axis=1)))
