"""Fit the Hunt-Crossley model f = K d^n + B d^n v with d = x - xc.

xc is the position of the contact point, which is also estimated. If xc and the exponent n are
given, the force is linear in K and B. Therefore, only xc and n are found by a nonlinear search. K
and B are found by linear least squares (variable projection).

The estimates of K and n are strongly correlated, and the unit of K depends on n. In the search, d
is therefore divided by its largest value D, and K D^n is estimated instead of K. The relative error
of K D^n is much smaller than the relative error of K.

n is not identifiable if its estimate is outside of the range `PLAUSIBLE`. xc is not identifiable if
its estimate is close to the lower end of the search range, or at the upper end. Both can occur if
the record has no sample near the contact point.

References
----------
K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact",
J. Applied Mechanics 42(2), 1975; G. H. Golub, V. Pereyra, "The differentiation of pseudo-inverses
and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal. 10(2), 1973.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from estimation.arrays import Floats
from estimation.batch_models.fit import (
    BatchData,
    BatchFit,
    FittedParameter,
    linear_solution,
    with_intervals,
)

EXPONENT = (0.5, 5.0)
"""Range of the exponent n in the search."""
PLAUSIBLE = (0.8, 4.5)
"""Range of plausible estimates of n. Outside of this range n is not identifiable."""
BEFORE = 2.0
"""The search range of xc starts about this distance before the smallest fitted position.

The unit of this distance is the range of the positions to which the model is fitted.
"""


def fit_hunt_crossley(data: BatchData) -> BatchFit:
    """Fit the Hunt-Crossley model f = K d^n + B d^n v, where d = x - xc, to a record.

    The parameters of the returned fit are K, B, the exponent n, and the contact point xc [m].
    """
    x, v, f = (channel[data.rows] for channel in (data.x, data.v, data.f - data.unloaded))
    travel = float(np.ptp(x))
    near = float(x.min()) + 0.02 * travel
    far = near - (BEFORE + 0.02) * travel

    def columns(xc: float, n: float, at: Floats, speed: Floats) -> Floats:
        size = float(x.max()) - xc
        power = (np.maximum(at - xc, 0.0) / size) ** n
        return np.column_stack([power, power * speed])

    def residual(searched: Floats) -> Floats:
        regressors = columns(searched[0] * travel, searched[1], x, v)
        return np.asarray(f - regressors @ linear_solution(regressors, f))

    starts = [(near - 0.05 * travel, 1.5), (far * 0.5 + near * 0.5, 1.2)]
    if data.contact is not None and far < data.contact < near:
        starts = [(data.contact, 1.3)]
    solutions = [
        least_squares(
            residual,
            (xc / travel, n),
            bounds=((far / travel, EXPONENT[0]), (near / travel, EXPONENT[1])),
            max_nfev=60,
        )
        for xc, n in starts
    ]
    solution = min(solutions, key=lambda one: one.cost)
    xc, n = float(solution.x[0] * travel), float(solution.x[1])
    stiffness, damping = linear_solution(columns(xc, n, x, v), f).tolist()
    size = float(x.max()) - xc
    depth = np.maximum(x - xc, 1e-9 * travel)
    force = columns(xc, n, x, v) @ [stiffness, damping]
    power = (depth / size) ** n
    fitted = [
        FittedParameter("K", stiffness / size**n, "N/m^n", power * size**n, (0.0, np.inf)),
        FittedParameter("B", damping / size**n, "N s/m^(n+1)", power * v * size**n),
        FittedParameter("n", n, "-", force * np.log(depth), PLAUSIBLE),
        FittedParameter("xc", xc, "m", -n * force / depth, (far + 0.02 * travel, near), True),
    ]
    predicted = columns(xc, n, data.x, data.v) @ [stiffness, damping] + data.unloaded
    return with_intervals("hunt-crossley", data, fitted, predicted)
