"""Fit by least squares, with variances that are valid for residuals of unknown autocorrelation.

Let X be the regressors, theta the parameters, e the residuals, and g' theta a linear combination of
the parameters. The error of g' theta is the sum of u_t = w_t e_t over all samples, with
w = X (X' X)^-1 g. The variance of this sum is n times the spectral density of u at frequency zero,
for n samples. The equal-weighted cosine (EWC) estimator computes this variance as the mean square
of the first B cosine coefficients of u. The estimate has B degrees of freedom, so the confidence
interval uses Student's t distribution with B degrees of freedom. The coverage of this interval is
close to 95 %. The coverage of a Newey-West interval with normal quantiles often is not close to
95 %.

The estimator assumes that the spectral density of u is the same at the first B cosines as at zero.
For a periodic motion, w oscillates with the frequency f0 of the motion. So the spectrum of u at
frequency zero is that of the residual at f0. The spectrum of u at the frequency d is that of the
residual at f0 - d and f0 + d. If B is the number of cycles, the highest frequency of the B cosines
is half of f0. More cosines would contain the residual near frequency zero. There, the residual due
to a baseline or friction is large. So B is at most the number of cycles. There is one exception: if
the number of cycles is below `FEWEST_COSINES`, B is `FEWEST_COSINES`.

The residuals of samples with a high leverage h are too small, because the fit follows these
samples. An example is the few samples at the beginning of a ramp, which determine the damping. As
in the HC2 estimator, the residual e is replaced by e / sqrt(1 - h). If the noise is white,
e / sqrt(1 - h) has the variance of the noise.

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

from estimation.compiled import Floats
from estimation.estimator import LEVEL_95

FEWEST_COSINES = 4
SMALLEST = 0.05
"""Lower limit of 1 - leverage. A sample with a smaller value determines a parameter alone."""


class RobustFit(NamedTuple):
    """A least-squares fit of n samples to m regressors."""

    theta: Floats
    """Parameters, shape (m,)."""
    residual: Floats
    """Residuals, shape (n,)."""
    inverse: Floats
    """The matrix (X' X)^-1 X' of the regressors X, shape (m, n)."""
    regressors: Floats
    """The regressors X, shape (n, m)."""

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample: the diagonal of X (X' X)^-1 X', shape (n,)."""
        return np.asarray(np.einsum("ij,ji->i", self.regressors, self.inverse))

    def deviation(self, gradient: Floats, cycles: float = math.inf) -> float:
        """Return the standard deviation of the linear combination gradient' theta.

        The value is scaled such that 1.96 times the value is the half width of the 95 % confidence
        interval. The variance is at least a quarter of the variance for uncorrelated residuals.

        Parameters
        ----------
        gradient
            Coefficients of the linear combination, shape (m,).
        cycles
            Number of cycles of a periodic motion in the n samples; infinite for other motions.
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
    """Return the number B of cosines in the equal-weighted cosine (EWC) estimator.

    Parameters
    ----------
    freedom
        Number of samples minus number of parameters.
    cycles
        Number of cycles of a periodic motion in the samples.
    """
    return max(FEWEST_COSINES, int(min(0.41 * max(freedom, 1) ** (2.0 / 3.0), cycles)))


def robust_fit(regressors: Floats, f: Floats) -> RobustFit:
    """Return the least-squares fit of f = X theta.

    The columns of X are first scaled to equal size, which makes the result more accurate.

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
    return RobustFit(theta, f - regressors @ theta, inverse, regressors)
