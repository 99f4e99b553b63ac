"""Fit the model of the standard linear solid.

The body is a spring k in parallel with a Maxwell element: a spring k1 in series with a damper
k1 tau. z is the deformation of the spring k1, and f0 is a constant force.

    f = k x + k1 z + f0,    z' = x' - z / tau

For a given tau, f is linear in k, k1, f0 and the initial value of k1 z. So tau is found by a
nonlinear search, and the other parameters by linear least squares (variable projection). The lower
end of the search range of tau is four standard deviations of the smoothing kernel. The upper end is
ten times the length of the record. tau is not identifiable if it is near the lower end of this
range or longer than half of the record.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import minimize_scalar

from estimation.arrays import Floats
from estimation.batch_models.fit import (
    BatchData,
    BatchFit,
    FittedParameter,
    linear_solution,
    with_intervals,
)
from estimation.batch_models.relaxation import relaxing_part


def relaxing(data: BatchData, tau: float) -> tuple[Floats, Floats]:
    """Return two regressors of the standard linear solid: z and exp(-t / tau), each of shape (n,).

    z is the solution of z' = x' - z / tau with the initial value 0. The second regressor describes
    the decay of an initial value that is not 0. Both regressors start again after each gap of the
    record: t is the time since the last gap or since the start of the record.
    """
    pieces = [piece - piece[0] for piece in np.split(data.x, data.starts[1:])]
    z = relaxing_part(pieces, float(data.t[1] - data.t[0]), tau)
    start = [np.exp(-(t - t[0]) / tau) for t in np.split(data.t, data.starts[1:])]
    return z, np.concatenate(start)


def fit_standard_linear_solid(data: BatchData) -> BatchFit:
    """Fit the standard linear solid to a record, with the parameters k, k1, tau, f0 and f1.

    The model is f = k x + k1 z + f0, with z' = x' - z / tau. f1 is the initial value of the force
    k1 z, at the start of the record and after each gap. The fit assumes that all these initial
    values are equal.
    """
    seconds = len(data.t) * float(data.t[1] - data.t[0])
    shortest = max(4.0 * data.width, 2.0 * float(data.t[1] - data.t[0]))
    longest = max(10.0 * seconds, 4.0 * shortest)
    f = data.f[data.rows]

    def columns(tau: float) -> Floats:
        z, start = relaxing(data, tau)
        return np.column_stack([data.x, z, np.ones(len(z)), start])

    def squares(log_tau: float) -> float:
        regressors = columns(math.exp(log_tau))[data.rows]
        return float(np.sum((f - regressors @ linear_solution(regressors, f)) ** 2))

    grid = np.linspace(math.log(shortest), math.log(longest), 16)
    best = int(np.argmin([squares(point) for point in grid]))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)])
    log_tau = float(minimize_scalar(squares, bounds=bounds, method="bounded").x)
    tau = math.exp(log_tau)
    regressors = columns(tau)
    theta = linear_solution(regressors[data.rows], f)
    step = 1e-3
    slope = (columns(tau * (1.0 + step)) - columns(tau * (1.0 - step))) @ theta / (2e-3 * tau)
    k, k1, f0, start = theta.tolist()
    rows = data.rows
    fitted = [
        FittedParameter("k", k, "N/m", regressors[rows, 0], (0.0, math.inf)),
        FittedParameter("k1", k1, "N/m", regressors[rows, 1], (0.0, math.inf)),
        FittedParameter("tau", tau, "s", slope[rows], (1.2 * shortest, 0.5 * seconds)),
        FittedParameter("f0", f0, "N", regressors[rows, 2], may_vanish=True),
        FittedParameter("f1", start, "N", regressors[rows, 3], may_vanish=True),
    ]
    return with_intervals("standard linear solid", data, fitted, regressors @ theta)
