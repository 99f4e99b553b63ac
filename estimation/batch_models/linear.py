"""Fit models by least squares. The models are linear in their parameters.

x is the displacement from a reference position, and f is the difference from a reference force. The
two references are called the datum. There are three models:

- Kelvin-Voigt: f = k x + b v.
- Kelvin-Voigt with datum: f = k x + b v + f0, where f0 is a constant force. With f0, the estimates
  of k and b do not depend on the datum.
- Stiffening: f = k x + k3 x^3 + b v + f0, where k is the stiffness at x = 0.
"""

from __future__ import annotations

import numpy as np

from estimation.batch_models.fit import (
    BatchData,
    BatchFit,
    FittedParameter,
    linear_solution,
    with_intervals,
)
from estimation.compiled import Floats

COLUMNS = {
    "kelvin-voigt": ("k", "b"),
    "kelvin-voigt with datum": ("k", "b", "f0"),
    "stiffening": ("k", "b", "f0", "k3"),
}
UNITS = {"k": "N/m", "b": "N s/m", "f0": "N", "k3": "N/m^3"}


def fit_linear(name: str, data: BatchData) -> BatchFit:
    """Return the fit of the linear model with this name, a key of `COLUMNS`."""
    parameters = COLUMNS[name]
    columns = np.column_stack([regressor(parameter, data) for parameter in parameters])
    theta = linear_solution(columns[data.rows], data.f[data.rows])
    fitted = [
        FittedParameter(
            parameter,
            float(value),
            UNITS[parameter],
            columns[data.rows, i],
            may_vanish=parameter in ("f0", "b"),
        )
        for i, (parameter, value) in enumerate(zip(parameters, theta, strict=True))
    ]
    return with_intervals(name, data, fitted, columns @ theta)


def regressor(parameter: str, data: BatchData) -> Floats:
    """Return the regressor of a parameter (k, b, f0 or k3), shape (n,).

    The regressor of k3 is the smoothed cube of the measured displacement. The cube of the smoothed
    displacement would be smaller, and the estimates of k and k3 biased.
    """
    if parameter == "k3":
        return data.smoothed(data.raw_x**3)
    return {"k": data.x, "b": data.v, "f0": np.ones(len(data.x))}[parameter]
