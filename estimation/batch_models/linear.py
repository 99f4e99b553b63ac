"""Fit models that are linear in their parameters, by least squares.

x is the displacement from a reference position, and f is the measured force minus a reference
force. The reference position and the reference force together are called the datum. There are three
models:

- Kelvin-Voigt: f = k x + b v.
- Kelvin-Voigt with datum: f = k x + b v + f0, where f0 is a constant force. With f0, the choice of
  the datum does not affect the estimates of k and b.
- Stiffening: f = k x + k3 x^3 + b v + f0, where k is the stiffness at x = 0.
"""

from __future__ import annotations

import numpy as np

from estimation.arrays import Floats
from estimation.batch_models.fit import (
    BatchData,
    BatchFit,
    FittedParameter,
    linear_solution,
    with_intervals,
)
from estimation.model import UNITS

COLUMNS = {
    "kelvin-voigt": ("k", "b"),
    "kelvin-voigt with datum": ("k", "b", "f0"),
    "stiffening": ("k", "b", "f0", "k3"),
}


def fit_linear(name: str, data: BatchData) -> BatchFit:
    """Fit one of the linear models to a record, and return the fit.

    `name` is the name of the model: `kelvin-voigt`, `kelvin-voigt with datum` or `stiffening`.
    """
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

    The regressor of k3 is x^3. It is smoothed like the force: first the measured x is cubed, then
    the cube is smoothed. If x was smoothed first, the peaks of x^3 would be too low, and the
    estimates of k and k3 would be biased.
    """
    if parameter == "k3":
        return data.smoothed(data.raw_x**3)
    return {"k": data.x, "b": data.v, "f0": np.ones(len(data.x))}[parameter]
