"""Recursive least squares with a covariance of constant trace."""

from __future__ import annotations

import math

from estimation.compiled import Parameters, Regressors, State
from estimation.methods.ud_factors import FactoredEstimator, add, learn, project, scale, take_in
from estimation.model import KELVIN_VOIGT, Model


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """P <- P - P z z' P / (1 + z' P z), then P <- c1 P / tr P + c2 I; gain P z / (1 + z' P z)."""
    m = len(phi)
    u = 4 * m + 3 + m * m
    d = u + m * m
    y = d + m
    scale(parameters, state, phi)
    project(state, phi)
    spread = take_in(state, phi, 1.0)
    trace = 0.0
    for j in range(m):
        squares = 1.0
        for i in range(j):
            squares += state[u + i * m + j] * state[u + i * m + j]
        trace += squares * state[d + j]
    share = parameters[4 + m] / trace
    for j in range(m):
        state[d + j] *= share
    for j in range(m):
        for i in range(m):
            state[y + i] = 0.0
        state[y + j] = 1.0
        add(state, phi, parameters[5 + m])
    learn(parameters, state, phi, f, dt, spread)


class ConstantTrace(FactoredEstimator):
    """Recursive least squares with a covariance of constant trace, regularised.

    The covariance is neither wound up by rest nor used up by motion: after each sample it is
    c1 P / tr P + c2 I, in units of P0 (K. J. Astrom and B. Wittenmark, "Adaptive Control", 2nd
    edition, Addison-Wesley, 1995, chapter 11). Where regressors of scaled squares
    phi_i^2 P0_i = q are at work, this forgets as a factor beta with c1 = m (1 - beta) / q does,
    faster with larger motion. A direction at rest gets all of the trace, and then follows
    noise.

    Parameters
    ----------
    trace
        c1, as a share of P0.
    initial_covariance
        Diagonal of P0, the unit of P, for b [(N s/m)^2] and k [(N/m)^2] and what else the model
        has, per N^2 of force variance.
    ratio
        c1 / c2: how far the variances of two directions may be apart, 1 to 1e8.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)

    def __init__(
        self,
        trace: float,
        initial_covariance: tuple[float, ...],
        ratio: float = 1e4,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        if not 0.0 < trace < math.inf:
            raise ValueError(f"trace must be positive and finite, got {trace}")
        if not 1.0 <= ratio <= 1e8:
            raise ValueError(f"ratio must be between 1 and 1e8, got {ratio}")
        super().__init__(1.0, initial_covariance, None, (trace, trace / ratio), model, correlation)
