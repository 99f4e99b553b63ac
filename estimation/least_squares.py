"""Batch least squares, the yardstick of the online estimators."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Floats


class Fit(NamedTuple):
    """Damping `b` [N s/m] and stiffness `k` [N/m] of all samples together, and the residual [N]."""

    b: float
    k: float
    residual: Floats

    @property
    def rms(self) -> float:
        """Root mean square of the residual [N]."""
        return float(np.sqrt(np.mean(self.residual**2)))


def least_squares(x: ArrayLike, v: ArrayLike, f: ArrayLike) -> Fit:
    """The (b, k) with the least sum of (f - b v - k x)^2; the shortest of several.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    """
    regressors = np.column_stack((v, x))
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled, *_ = np.linalg.lstsq(regressors / scale, np.asarray(f), rcond=None)
    b, k = scaled / scale
    return Fit(float(b), float(k), np.asarray(f) - regressors @ (b, k))
