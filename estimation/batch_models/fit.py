"""Define the data and the result of a batch fit, and compute intervals and goodness of fit.

Position and force are smoothed by the same kernel. A model is fitted to a part of the smoothed
samples, called the fitted samples. The time between successive fitted samples is so long that their
noise is independent. The information criteria and the autocorrelation are computed from the
residuals of the fitted samples. R^2 and the root mean square residual are computed from the
measured force of all samples in contact. The confidence intervals are computed with the Jacobian of
the model at the fitted parameters. These intervals are valid for residuals of any autocorrelation
(`estimation.robust_error`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.robust_error import RobustFit
from estimation.smoothing import smooth_pieces


class BatchData(NamedTuple):
    """A record of n samples with a constant sample period.

    The datum consists of a reference position and a reference force, which are subtracted from the
    position and the force. If no shape is stated, an array has the shape (n,).
    """

    t: Floats
    """Time [s]."""
    x: Floats
    """Smoothed displacement from the reference position [m]."""
    raw_x: Floats
    """Measured displacement from the reference position, without smoothing [m]."""
    v: Floats
    """Velocity [m/s]."""
    f: Floats
    """Smoothed force minus the reference force [N]."""
    raw_f: Floats
    """Measured force minus the reference force, without smoothing [N]."""
    rows: NDArray[np.intp]
    """Indices of the samples to which the model is fitted, shape (number of these samples,)."""
    inside: NDArray[np.intp]
    """Indices of the samples in contact, shape (number of these samples,)."""
    starts: tuple[int, ...] = (0,)
    """Index of the first sample of each piece. A piece is a part of the record without gaps."""
    width: float = 0.0
    """Standard deviation of the smoothing kernel [s]."""
    contact: float | None = None
    """Displacement of the contact point from the reference position [m]; None if not known."""
    unloaded: float = 0.0
    """Force out of contact minus the reference force [N]. If the force out of contact is not known,
    it is assumed that the sensor reads 0 out of contact."""
    baseline: Floats | None = None
    """Regressors of the baseline (the slow part of the force) at the samples `rows`, with m
    columns. The baseline was subtracted from the force. Its regressors are part of the Jacobian, so
    that the confidence intervals contain the uncertainty of the baseline. None if no baseline was
    subtracted."""
    cycles: float = math.inf
    """Number of cycles of a periodic motion in the record; infinite for other motions."""

    def smoothed(self, values: Floats) -> Floats:
        """Return the values after smoothing with the Gaussian kernel of the record, shape (n,).

        Position and force of the record are smoothed with the same kernel. The record may have
        gaps. The values are not smoothed across a gap.
        """
        return smooth_pieces(values, self.starts, self.width / float(self.t[1] - self.t[0]))

    def sharpened(self, values: Floats) -> Floats:
        """Return smoothed values with peaks nearly as high as before the smoothing, shape (n,).

        `values` are values y that were smoothed with the kernel of the record. The result is
        2 y - H y, where H y are the values y after a second smoothing with this kernel.
        """
        return 2.0 * values - self.smoothed(values)


class Parameter(NamedTuple):
    """An estimated parameter with its 95 % confidence interval."""

    value: float
    """Estimate, in `unit`."""
    low: float
    """Lower end of the interval, in `unit`."""
    high: float
    """Upper end of the interval, in `unit`."""
    unit: str
    """Unit of the parameter."""
    identifiable: bool
    """True if the record determines the parameter: the value is in its plausible range, and the
    confidence interval does not contain zero. Some parameters can be identifiable although the
    interval contains zero, see `FittedParameter.may_vanish`."""


class BatchFit(NamedTuple):
    """Result of the fit of one model to a record."""

    name: str
    """Name of the model."""
    parameters: dict[str, Parameter]
    """Parameters by name."""
    r2: float
    """Coefficient of determination R^2, for the measured force."""
    rms: float
    """Root mean square of the residual of the measured force [N]."""
    aic: float
    """Akaike information criterion."""
    bic: float
    """Bayesian information criterion."""
    autocorrelation: float
    """Correlation coefficient of successive residuals of the fitted samples."""
    predicted: Floats
    """Force that the fitted model predicts [N], shape (n,); NaN out of contact."""

    @property
    def identifiable(self) -> bool:
        """True if the record determines all parameters of the model, except possibly `f1`.

        `f1` is a parameter of the standard linear solid only. It is the initial value of the force
        that relaxes, and is not a property of the material.
        """
        return all(one.identifiable for name, one in self.parameters.items() if name != "f1")

    def summary(self) -> dict[str, object]:
        """Return the fit, without the predicted force, as a dictionary that JSON can represent."""
        parameters = {name: one._asdict() for name, one in self.parameters.items()}
        return {
            "name": self.name,
            "parameters": parameters,
            "r2": self.r2,
            "rms": self.rms,
            "aic": self.aic,
            "bic": self.bic,
            "residual_autocorrelation": self.autocorrelation,
        }


class FittedParameter(NamedTuple):
    """A fitted parameter whose confidence interval is not computed yet."""

    name: str
    """Name of the parameter."""
    value: float
    """Estimate, in `unit`."""
    unit: str
    """Unit of the parameter."""
    jacobian: Floats
    """Derivative of the model's force with respect to the parameter, at the fitted samples."""
    plausible: tuple[float, float] = (-math.inf, math.inf)
    """Plausible range of the value. Outside of this range the parameter is not identifiable."""
    may_vanish: bool = False
    """Whether the parameter can be identifiable although its confidence interval contains zero.

    If True, a parameter with a narrow interval is identifiable. The interval is narrow if a change
    of the parameter by the half width of the interval changes the force (root mean square) by less
    than the range of the force.
    """


def with_intervals(
    name: str, data: BatchData, fitted: list[FittedParameter], predicted: Floats
) -> BatchFit:
    """Compute confidence intervals and goodness of fit, and return them with the fit.

    `predicted` is the force [N] that the fitted model predicts from the smoothed motion, shape
    (n,).
    """
    residual = data.f[data.rows] - predicted[data.rows]
    jacobian = np.column_stack([one.jacobian for one in fitted])
    sizes = np.maximum(np.sqrt(np.mean(jacobian**2, axis=0)), 1e-300).tolist()
    values = np.array([one.value for one in fitted])
    if data.baseline is not None:
        jacobian = np.column_stack([jacobian, data.baseline])
        values = np.concatenate([values, np.zeros(data.baseline.shape[1])])
    scale = np.sqrt(np.mean(jacobian**2, axis=0))
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(jacobian / scale, rcond=1e-9) / scale[:, None]
    fit = RobustFit(values, residual, inverse, jacobian)
    parameters = {}
    span = float(np.ptp(data.f[data.rows]))
    for i, one in enumerate(fitted):
        half = LEVEL_95 * fit.deviation(np.eye(len(values))[i], data.cycles)
        low, high = one.plausible
        known = low < one.value < high and math.isfinite(half)
        known = known and half < (span / sizes[i] if one.may_vanish else abs(one.value))
        parameters[one.name] = Parameter(
            one.value, one.value - half, one.value + half, one.unit, known
        )
    n, m = len(residual), len(fitted)
    likelihood = n * math.log(max(float(np.mean(residual**2)), 1e-300))
    shown = np.full(len(predicted), np.nan)
    shown[data.inside] = data.sharpened(predicted)[data.inside]
    measured = data.raw_f[data.inside] - shown[data.inside]
    variance = float(np.var(data.raw_f[data.inside]))
    return BatchFit(
        name,
        parameters,
        1.0 - float(np.mean(measured**2)) / max(variance, 1e-300),
        math.sqrt(float(np.mean(measured**2))),
        likelihood + 2.0 * m,
        likelihood + m * math.log(n),
        float(residual[1:] @ residual[:-1] / max(float(residual @ residual), 1e-300)),
        shown,
    )


def linear_solution(columns: Floats, f: Floats) -> Floats:
    """Return the parameters theta of the least-squares fit f = columns @ theta, shape (m,).

    Each regressor is first divided by its root mean square. This reduces rounding errors.
    """
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / scale, f, rcond=1e-10)[0] / scale)
