"""Fit a model to all samples at once by least squares, to compare with the online estimators."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation.arrays import Floats


class Fit(NamedTuple):
    """Result of a least-squares fit of a model to n samples: parameters and n residuals."""

    b: float
    """Damping [N s/m]."""
    k: float
    """Stiffness [N/m]."""
    residual: Floats
    """Residual force f - phi' theta [N], shape (n,)."""
    further: tuple[float, ...] = ()
    """Parameters of the model besides b and k."""

    @property
    def rms(self) -> float:
        """Root mean square of the residual [N]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def e_f(self) -> float:
        """Mean of the absolute values of the residual [N]."""
        return float(np.mean(np.abs(self.residual)))

    def summary(self, names: Iterable[str]) -> dict[str, Any]:
        """Return the parameters and the residuals `rms` and `e_f` as a dictionary for JSON.

        `names` contains the names of the parameters besides b and k.
        """
        return {
            "b": self.b,
            "k": self.k,
            "e_f": self.e_f,
            "one_step_rms": self.rms,
            "further": dict(zip(names, self.further, strict=True)),
        }


def no_fit(samples: int, further: int) -> Fit:
    """Return a `Fit` whose values are all NaN, for samples to which no model is fitted.

    `samples` is the number of samples, and `further` is the number of parameters besides b and k.
    """
    return Fit(math.nan, math.nan, np.full(samples, math.nan), (math.nan,) * further)


def least_squares(
    x: ArrayLike, v: ArrayLike, f: ArrayLike, further: ArrayLike | None = None
) -> Fit:
    """Fit a model f = phi' theta to samples: minimise the sum of (f - phi' theta)^2.

    The regressors are phi = [v, x, ...], and the parameters are theta = [b, k, ...]. Each regressor
    is first scaled to a root mean square of 1. If the minimum is not unique, the solution with the
    smallest norm of the scaled parameters is returned.

    Parameters
    ----------
    x, v, f
        Displacement [m], velocity [m/s], force [N], each of shape (n,).
    further
        Values of the model's regressors besides v and x, shape (n, regressors - 2). Default: none.
    """
    columns = [v, x] if further is None else [v, x, *np.asarray(further).T]
    regressors = np.column_stack(columns)
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled, *_ = np.linalg.lstsq(regressors / scale, np.asarray(f), rcond=None)
    theta = scaled / scale
    b, k, *more = theta.tolist()
    return Fit(b, k, np.asarray(f) - regressors @ theta, tuple(more))
