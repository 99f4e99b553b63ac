"""Make several least-squares fits to the same values f, all with the same baseline.

A baseline is the slow part of a signal. The regressors of a fit are the columns of two matrices, B
and X. B contains the regressors of the baseline. B has many columns, and is the same in every fit.
X contains the other regressors, for example v and x. X has few columns, and is different in each
fit.

First, X and f are projected onto the subspace that is orthogonal to the columns of B. The
parameters of X and the residual of the fit are computed from these projections (Frisch, Waugh and
Lovell). B is decomposed only once, for all fits. Let X have m columns, let B have p columns, and
let there be n samples. Then the time for a fit is proportional to n m p. A fit without this method
takes a time proportional to n (m + p)^2.

References
----------
M. C. Lovell, "Seasonal adjustment of economic time series and multiple regression analysis",
J. American Statistical Association 58(304), 1963.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from estimation.arrays import Floats
from estimation.robust_error import RobustFit, robust_fit

RANK = 1e-10
"""Limit below which a ratio is treated as zero.

One ratio is a singular value of B, divided by the largest singular value of B. The other ratio is
the norm of the part of a column of X that is orthogonal to B, divided by the norm of the column.
"""


class BaselineFits:
    """Fit a signal by a baseline (the slow part of the signal) and other regressors.

    The baseline is prepared once. Then `fit` can be called with different other regressors.

    `basis` is B, shape (n, p), and `f` has the shape (n,).

    Attributes
    ----------
    rest
        The residual of a fit of the baseline alone, shape (n,).
    """

    def __init__(self, basis: Floats, f: Floats) -> None:
        q, r = np.linalg.qr(basis)
        u, s, vt = np.linalg.svd(r)
        kept = s > RANK * s[0]
        self.orthogonal = q @ u[:, kept]
        self.to_theta = vt[kept].T / s[kept]
        self.leverage = np.einsum("ij,ij->i", self.orthogonal, self.orthogonal)
        self.along = f @ self.orthogonal
        self.rest = f - self.orthogonal @ self.along

    def fit(self, columns: Floats) -> RobustFit:
        """Return the least-squares fit of the baseline and of other regressors to the signal.

        The signal and the baseline are those that were given to the class. `columns` contains the
        other regressors, shape (n, m). The parameters `theta` of the fit are first the p parameters
        of the baseline, and then the m parameters of the other regressors.
        """
        q = self.orthogonal
        along = q.T @ columns
        beyond = columns - q @ along
        again = q.T @ beyond  # the second projection removes the rounding error of the first
        along, beyond = along + again, beyond - q @ again
        size = np.linalg.norm(columns, axis=0)
        beyond[:, np.linalg.norm(beyond, axis=0) < RANK * size] = 0.0
        own = robust_fit(beyond, self.rest)
        slow = self.to_theta @ (self.along - along @ own.theta)
        inverse: Any = Inverse(self, along, own)
        return FitWithBaseline(
            np.concatenate([slow, own.theta]), own.residual, inverse, own.regressors
        )


class Inverse:
    """The matrix (Z' Z)^-1 Z' of a least-squares fit with the regressors Z, shape (p + m, n).

    Z = [B, X] consists of the p regressors B of a baseline and m other regressors X. The matrix
    itself is not stored, because it would be large. If `inverse` is an object of this class, only
    the product `gradients @ inverse` can be computed, where `gradients` is a vector or a matrix.

    `along` is Q' X, shape (p, m). `own` is the fit with the regressors X - Q Q' X, which are the
    part of X that is orthogonal to B.
    """

    __array_ufunc__ = None  # numpy then leaves the product to __rmatmul__

    def __init__(self, baseline: BaselineFits, along: Floats, own: RobustFit) -> None:
        self.baseline, self.along, self.own = baseline, along, own

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample, shape (n,).

        The leverages are the diagonal of Z (Z' Z)^-1 Z', where Z contains all regressors of a fit.
        """
        return np.asarray(self.baseline.leverage + self.own.leverage)

    def __rmatmul__(self, gradients: Floats) -> Floats:
        """Return the product `gradients @ inverse`, where `inverse` is this object.

        This object stands for a matrix of shape (p + m, n). `gradients` has the shape (p + m,) or
        (r, p + m), and the product has the shape (n,) or (r, n).
        """
        size = len(self.baseline.to_theta)
        slow = gradients[..., :size] @ self.baseline.to_theta
        own = gradients[..., size:] - slow @ self.along
        product = np.asarray(own @ self.own.inverse)
        if slow.any():
            product += slow @ self.baseline.orthogonal.T
        return product


class FitWithBaseline(RobustFit):
    """A least-squares fit with the regressors B of a baseline and other regressors X.

    `BaselineFits.fit` returns such a fit. Two fields differ from the base class. `inverse` is
    not an array, but an object of the class `Inverse`, which can be multiplied from the left.
    `regressors` contains only the part of X that is orthogonal to B, shape (n, m).
    """

    __slots__ = ()

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample, shape (n,).

        The leverages are the diagonal of Z (Z' Z)^-1 Z', where Z contains all regressors of the
        fit, including those of the baseline.
        """
        inverse: Any = self.inverse
        return np.asarray(inverse.leverage)
