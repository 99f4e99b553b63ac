"""What every batch fit has: parameters with intervals, and measures of the fit.

The fit is of smoothed samples, position and force alike, far enough apart for their noise to be
independent. The information criteria and the autocorrelation are those of these residuals. R^2 and
the residual are those of the force as measured. The intervals hold for residuals of any
autocorrelation (`estimation.robust_error`), with the Jacobian of the model at the fit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Floats
from estimation.estimator import LEVEL_95
from estimation.robust_error import RobustFit


class BatchData(NamedTuple):
    """A record on an even grid, arrays of shape (n,)."""

    t: Floats
    """Time [s]."""
    x: Floats
    """Smoothed displacement from the datum [m]."""
    v: Floats
    """Velocity [m/s]."""
    f: Floats
    """Smoothed force from the datum [N]."""
    raw_f: Floats
    """Force as measured, from the datum [N]."""
    rows: NDArray[np.intp]
    """Samples of the fit."""
    inside: NDArray[np.intp]
    """Samples in contact."""
    starts: tuple[int, ...] = (0,)
    """First sample of each piece between gaps."""
    width: float = 0.0
    """Standard deviation of the smoothing [s]."""
    contact: float | None = None
    """Contact point where it is known [m]."""
    unloaded: float = 0.0
    """Force out of contact, or the sensor's zero where that is not known, from the datum [N]."""


class Parameter(NamedTuple):
    """An estimated parameter with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str
    identifiable: bool
    """Whether the data determine it: within its plausible range, and better than its own size."""


class BatchFit(NamedTuple):
    """One model fitted to a record."""

    name: str
    parameters: dict[str, Parameter]
    r2: float
    """Share of the variance of the measured force that it explains."""
    rms: float
    """Root mean square of the residual of the measured force [N]."""
    aic: float
    bic: float
    autocorrelation: float
    """Of the residual, from one independent sample to the next."""
    predicted: Floats
    """Force on the grid [N], shape (n,), NaN out of contact."""

    @property
    def identifiable(self) -> bool:
        """Whether the data determine all parameters but the offsets."""
        return all(one.identifiable for name, one in self.parameters.items() if name != "f1")

    def summary(self) -> dict[str, object]:
        """Return the fit as a document."""
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


class Shape(NamedTuple):
    """A parameter before its interval is known."""

    name: str
    value: float
    unit: str
    jacobian: Floats
    """Derivative of the force at the rows, shape (rows,)."""
    plausible: tuple[float, float] = (-math.inf, math.inf)
    """Range outside of which the parameter is not identified."""
    may_vanish: bool = False
    """Whether zero is a plausible value, so that an interval about it identifies the parameter."""


def finished(name: str, data: BatchData, shapes: list[Shape], predicted: Floats) -> BatchFit:
    """Return the fit with its intervals and measures.

    Parameters
    ----------
    name
        Name of the model.
    data
        The record.
    shapes
        Its parameters.
    predicted
        Its force on the grid [N], shape (n,).
    """
    residual = data.f[data.rows] - predicted[data.rows]
    jacobian = np.column_stack([shape.jacobian for shape in shapes])
    scale = np.sqrt(np.mean(jacobian**2, axis=0))
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(jacobian / scale, rcond=1e-9) / scale[:, None]
    fit = RobustFit(np.array([shape.value for shape in shapes]), residual, inverse)
    parameters = {}
    for i, shape in enumerate(shapes):
        half = LEVEL_95 * fit.deviation(np.eye(len(shapes))[i])
        low, high = shape.plausible
        known = low < shape.value < high and math.isfinite(half)
        known = known and (shape.may_vanish or half < abs(shape.value))
        parameters[shape.name] = Parameter(
            shape.value, shape.value - half, shape.value + half, shape.unit, known
        )
    n, m = len(residual), len(shapes)
    likelihood = n * math.log(max(float(np.mean(residual**2)), 1e-300))
    measured = data.raw_f[data.inside] - predicted[data.inside]
    variance = float(np.var(data.raw_f[data.inside]))
    shown = np.full(len(predicted), np.nan)
    shown[data.inside] = predicted[data.inside]
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
    """Return the least-squares parameters; the columns are scaled first."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(columns / scale, f, rcond=1e-10)[0] / scale)
