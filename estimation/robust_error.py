"""Fit by least squares, with confidence intervals that are valid for autocorrelated residuals.

Let X be the regressors of n samples, theta the parameters, e the residuals, and g' theta a linear
combination of the parameters. The error of g' theta is the sum of u_t = w_t e_t over all samples t,
with the weights w = X (X' X)^-1 g. The variance of this sum is n times the spectral density of u at
frequency zero. The equal-weighted cosine (EWC) estimator computes this variance as the mean square
of the first B coefficients of the cosine transform of u. This mean square has B degrees of freedom.
So the confidence interval is computed with Student's t distribution for B degrees of freedom. This
interval contains the true value in close to 95 % of all cases. A Newey-West interval with normal
quantiles often contains it in fewer cases.

The EWC estimator assumes that the spectral density of u is constant from zero to the frequency of
the last cosine. For a periodic motion with the frequency f0, the weights w also oscillate with f0.
The spectrum of u = w e at the frequency d is then the spectrum of the residual e at f0 - d and
f0 + d. If d is near f0, this includes the residual near frequency zero. There, the residual is
large due to friction and slow drift of the force. Therefore B is at most the number of cycles of
the motion. The frequency of the last cosine is then at most f0 / 2. If the motion has fewer cycles
than `FEWEST_COSINES`, B is `FEWEST_COSINES`.

The fit follows some samples closely, for example the few samples at the beginning of a ramp, which
determine the damping. The residuals of such samples are too small. Their leverage h (the diagonal
of X (X' X)^-1 X') is near 1. As in the HC2 estimator, each residual e is replaced by
e / sqrt(1 - h). If the noise is white, e / sqrt(1 - h) has the variance of the noise.

References
----------
E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice",
J. Business & Economic Statistics 36(4), 2018; J. G. MacKinnon, H. White, "Some
heteroskedasticity-consistent covariance matrix estimators with improved finite sample properties",
J. Econometrics 29(3), 1985.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.fft import dct
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95

FEWEST_COSINES = 4
"""Smallest number of cosines in the equal-weighted cosine estimator."""
SMALLEST = 0.05
"""Lower limit of 1 - leverage in the division by sqrt(1 - leverage).

If 1 - leverage of a sample is near zero, this sample determines a parameter almost alone.
"""


class RobustFit(NamedTuple):
    """Result of a least-squares fit f = X theta, for n samples and m regressors."""

    theta: Floats
    """Fitted parameters, shape (m,)."""
    residual: Floats
    """Residuals f - X theta, shape (n,)."""
    inverse: Floats
    """The matrix (X' X)^-1 X' of the regressors X, shape (m, n)."""
    regressors: Floats
    """The regressors X, shape (n, m)."""

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample, from 0 to 1: the diagonal of X (X' X)^-1 X', shape (n,).

        The leverage is near 1 if the fit is forced to follow the sample.
        """
        return np.asarray(np.einsum("ij,ji->i", self.regressors, self.inverse))

    def deviation(self, gradient: Floats, cycles: float = math.inf) -> float:
        """Return the standard deviation of gradient' theta, valid for autocorrelated residuals.

        The value is scaled such that 1.96 times the value is the half width of the 95 % confidence
        interval, which is computed with Student's t distribution. A standard deviation (before this
        scaling) that is below half of that for uncorrelated residuals is replaced by this half.
        """
        n, m = len(self.residual), len(self.theta)
        left_out = self.residual / np.sqrt(np.maximum(1.0 - self.leverage, SMALLEST))
        terms = (gradient @ self.inverse) * left_out
        terms = terms - terms.mean()
        count = cosine_count(n - m, cycles)
        sums = dct(terms)[1 : count + 1] / math.sqrt(2.0)
        quantile = float(stdtrit(count, 0.975)) / LEVEL_95
        ewc = float(np.mean(sums**2))
        white = float(np.sum(terms**2))
        return quantile * math.sqrt(max(ewc, 0.25 * white))


def cosine_count(freedom: int, cycles: float = math.inf) -> int:
    """Return the number B of cosines from which the variance of a least-squares fit is estimated.

    The equal-weighted cosine (EWC) estimator uses the first B coefficients of a cosine transform.
    B is the smaller of 0.41 freedom^(2/3) and `cycles`, rounded down, but at least
    `FEWEST_COSINES`.

    `freedom` is the number of samples minus the number of parameters. `cycles` is the number of
    cycles of a periodic motion, infinite for other motions.
    """
    return max(FEWEST_COSINES, int(min(0.41 * max(freedom, 1) ** (2.0 / 3.0), cycles)))


def robust_fit(regressors: Floats, f: Floats) -> RobustFit:
    """Fit the parameters theta of f = X theta by least squares.

    Before the fit, each column of X is divided by its root mean square. This reduces rounding
    errors.
    """
    scale = np.sqrt(np.mean(regressors**2, axis=0))
    scale[scale == 0.0] = 1.0
    Q, R = np.linalg.qr(regressors / scale)
    inverse = np.linalg.pinv(R, rcond=1e-10) @ Q.T / scale[:, None]
    theta = inverse @ f
    return RobustFit(theta, f - regressors @ theta, inverse, regressors)


def bayesian_criterion(residual: Floats, parameters: int) -> float:
    """Return the Bayesian information criterion of a fit.

    `residual` is the measured values minus the fitted values, shape (n,). `parameters` is the
    number of fitted parameters.
    """
    n = len(residual)
    return n * math.log(max(float(np.mean(residual**2)), 1e-300)) + parameters * math.log(n)
