"""Recursive least squares with a covariance matrix whose trace is constant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.method_settings import MethodSettings
from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add_variance,
    correct_with_gain,
    trace,
    update_covariance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

TRACE = 2.2e-4
"""Setting c1 of `rls_trace`, divided by m (1 - beta).

c1 is the trace of the covariance matrix, m the number of parameters, and beta the forgetting factor
of `rls`. The settling time (see `benchmarks/tuning.py`) is 0.29 s, and 0.30 s for 0.8 times this
value.

Let q = phi_i^2 P0_i, where phi_i is a regressor and P0_i the initial variance of its parameter.
With c1 = m (1 - beta) / q, `rls_trace` forgets as fast as `rls`. For regressors with the typical
values of a preset, q is 1e4. So `rls_trace` forgets 2.2e-4 * 1e4 = 2.2 times as fast as `rls`.
"""


@dataclass(frozen=True, slots=True)
class ConstantTraceParameters(FactoredParameters):
    """Constant settings of the estimator `ConstantTrace`, which `step` reads."""

    c1: float
    """Trace of the covariance before c2 is added, in units of P0."""
    c2: float
    """Value that is added to the variance of each parameter, in units of P0."""


def step(
    parameters: ConstantTraceParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update the covariance P, set its trace to a constant, and update theta.

    First P <- P - P z z' P / (1 + z' P z) is set, and then P <- c1 P / tr P + c2 I. theta is
    updated with the gain P z / (1 + z' P z), where P is the covariance before this sample.

    z contains the scaled regressors s_i phi_i, where s_i is the initial standard deviation of
    parameter i. P is the covariance of the scaled parameters theta_i / s_i, see `ud_factors`.
    c1 is the setting `trace`, and c2 is c1 / `ratio`.
    """
    spread = update_covariance(parameters, state, phi, 1.0)
    D, c2 = state.D, parameters.c2
    share = parameters.c1 / trace(state)
    for j in below[len(phi)]:
        D[j] *= share
    for j in below[len(phi)]:
        add_variance(state, j, c2)
    correct_with_gain(parameters, state, phi, f, dt, spread)


class ConstantTrace(FactoredEstimator):
    """Recursive least squares with a regularised covariance matrix whose trace is constant.

    After each sample, the covariance P is set to c1 P / tr P + c2 I, in units of the initial
    covariance P0 (K. J. Astrom and B. Wittenmark, "Adaptive Control", 2nd edition, Addison-Wesley,
    1995, chapter 11). So P does not increase without limit at rest, and does not decrease to zero
    in motion.

    For a given c1, a larger motion causes faster forgetting. An example is a motion for which the
    mean of phi_i^2 times P0_i has the same value q for all m regressors. The trace
    c1 = m (1 - beta) / q then has the same effect as the forgetting factor beta.

    If the motion does not excite a direction in the space of the parameters, the variance in this
    direction increases until it is nearly the whole trace. The estimate in this direction then
    follows the noise.

    Parameters
    ----------
    trace
        c1, the trace of P before c2 I is added, in units of P0.
    initial_covariance
        As in `RecursiveLeastSquares`.
    ratio
        Ratio c1 / c2, from 1 to 1e8. The variance in one direction is at most 1 + c1 / c2 times the
        variance in another direction, in units of P0.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameter_type = ConstantTraceParameters

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
        super().__init__(
            1.0, initial_covariance, None, model, correlation, c1=trace, c2=trace / ratio
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            TRACE * settings.model.regressors * (1.0 - settings.forgetting),
            settings.covariance,
            model=settings.model,
            correlation=settings.correlation,
        )
