"""Variances of a least-squares fit that are valid for residuals of unknown autocorrelation.

The error of a linear combination g' theta of the parameters is the sum of u_t = w_t e_t, with the
residuals e and w = X (X' X)^-1 g. Its variance is the spectrum of u at frequency zero. The
equal-weighted cosine (EWC) estimator computes it as an average over the first B cosines, and has B
degrees of freedom. The interval therefore uses Student's t distribution with B degrees of freedom.
Its coverage is close to 95 %, which that of a Newey-West interval with normal quantiles often is
not.

References
----------
E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice",
J. Business & Economic Statistics 36(4), 2018.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.fft import dct
from scipy.special import stdtrit

from estimation.compiled import Floats
from estimation.estimator import LEVEL_95

FEWEST_COSINES = 4


class RobustFit(NamedTuple):
    """A least-squares fit of n samples to m regressors."""

    theta: Floats
    """Parameters, shape (m,)."""
    residual: Floats
    """Residuals, shape (n,)."""
    inverse: Floats
    """(X' X)^-1 X', shape (m, n)."""

    def deviation(self, gradient: Floats) -> float:
        """Return the standard deviation of gradient' theta.

        It is scaled such that 1.96 times its value is the half width of the 95 % interval.

        Parameters
        ----------
        gradient
            Coefficients of the linear combination, shape (m,).
        """
        n, m = len(self.residual), len(self.theta)
        terms = (gradient @ self.inverse) * self.residual
        terms = terms - terms.mean()
        count = cosine_count(n - m)
        sums = dct(terms)[1 : count + 1] / math.sqrt(2.0)
        freedom = n / max(n - m, 1)
        quantile = float(stdtrit(count, 0.975)) / LEVEL_95
        ewc = float(np.mean(sums**2))
        white = float(np.sum(terms**2))
        return quantile * math.sqrt(freedom * max(ewc, 0.25 * white))


def cosine_count(freedom: int) -> int:
    """Return the number B of cosines; `freedom` is the number of samples minus parameters."""
    return max(FEWEST_COSINES, int(0.41 * max(freedom, 1) ** (2.0 / 3.0)))


def robust_fit(regressors: Floats, f: Floats) -> RobustFit:
    """Fit by least squares; the columns are scaled to equal size first.

    Parameters
    ----------
    regressors
        Regressors X, shape (n, m).
    f
        Values to fit, shape (n,).
    """
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scale[scale == 0.0] = 1.0
    Q, R = np.linalg.qr(regressors / scale)
    inverse = np.linalg.pinv(R, rcond=1e-10) @ Q.T / scale[:, None]
    theta = inverse @ f
    return RobustFit(theta, f - regressors @ theta, inverse)
