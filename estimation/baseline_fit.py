"""Make several least-squares fits that have the same baseline among their regressors.

The regressors of a fit are the columns of two matrices, B and X. B contains the regressors of the
baseline. It has many columns, and is the same in every fit. X contains the other regressors. It has
few columns, and is different in each fit.

First, the components along B are subtracted from X and from the values f. The differences are
orthogonal to B. The parameters of X and the residual of the fit are computed from these differences
(Frisch, Waugh and Lovell). B is decomposed only once. Let X have m columns, B have p columns, and
let there be n samples. Then the time for a fit is proportional to n m p. Without this method, it
would be proportional to n (m + p)^2.

References
----------
M. C. Lovell, "Seasonal adjustment of economic time series and multiple regression analysis",
J. American Statistical Association 58(304), 1963.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from estimation.compiled import Floats
from estimation.robust_error import RobustFit, robust_fit

RANK = 1e-10
"""Relative limit below which values are treated as zero.

It applies to the singular values of B, relative to the largest one. It also applies to the part of
a column of X that is orthogonal to B, relative to the norm of the column.
"""


class BaselineFits:
    """Fits a baseline and other regressors to one signal.

    Parameters
    ----------
    basis
        Regressors B of the baseline, shape (n, p).
    f
        Values to fit, shape (n,).

    Attributes
    ----------
    rest
        The values minus their least-squares baseline, shape (n,).
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

        `columns` contains the other regressors, shape (n, m). The first parameters of the fit are
        those of the baseline.
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
    """The matrix (Z' Z)^-1 Z' of a fit, shape (p + m, n). Z = [B, X] contains all regressors.

    The matrix itself is not stored. An object of this class can only be the right factor of a
    product `gradients @ inverse`. The left factor is a vector or a matrix.

    Parameters
    ----------
    baseline
        The decomposed baseline B.
    along
        Components of X along the orthonormal basis of B, shape (p, m).
    own
        Fit of the part of X that is orthogonal to B.
    """

    __array_ufunc__ = None  # numpy then leaves the product to __rmatmul__

    def __init__(self, baseline: BaselineFits, along: Floats, own: RobustFit) -> None:
        self.baseline, self.along, self.own = baseline, along, own

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample: the diagonal of Z (Z' Z)^-1 Z', shape (n,)."""
        return np.asarray(self.baseline.leverage + self.own.leverage)

    def __rmatmul__(self, gradients: Floats) -> Floats:
        """Return the product of `gradients`, shape (p + m,) or (r, p + m), with this matrix."""
        size = len(self.baseline.to_theta)
        slow = gradients[..., :size] @ self.baseline.to_theta
        own = gradients[..., size:] - slow @ self.along
        product = np.asarray(own @ self.own.inverse)
        if slow.any():
            product += slow @ self.baseline.orthogonal.T
        return product


class FitWithBaseline(RobustFit):
    """A fit of a baseline and of other regressors X. `BaselineFits.fit` returns such a fit.

    The field `inverse` is an object of the class `Inverse`. The field `regressors` does not contain
    the regressors of the baseline. It contains X minus the components of X along the baseline.
    """

    __slots__ = ()

    @property
    def leverage(self) -> Floats:
        """Leverage of each sample, shape (n,).

        It is the diagonal of Z (Z' Z)^-1 Z'. The matrix Z contains all regressors of the fit.
        """
        inverse: Any = self.inverse
        return np.asarray(inverse.leverage)
