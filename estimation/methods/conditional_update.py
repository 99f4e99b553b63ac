"""Recursive least squares that does not use samples with little information."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.method_settings import MethodSettings
from estimation.methods.recursive_least_squares import update_and_forget
from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    forgetting_factor,
    predicted_variance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors

FORGETTING = 2.0
"""The forgetting factor of `rls_conditional` is the preset's forgetting factor to this power.

The settling time (see `benchmarks/tuning.py`) is 0.28 s, and 0.30 s for 0.8 times this value.
"""
THRESHOLD = 1.5
"""Threshold c of `rls_conditional`, which uses only samples with enough information.

The value is the midpoint of the useful range from 1 to m, where m = 2 is the number of parameters
of the Kelvin-Voigt model.
"""


@dataclass(frozen=True, slots=True)
class ConditionalParameters(FactoredParameters):
    """Constant settings of the estimator `ConditionalUpdate`, which `step` reads."""

    c: float
    """Threshold c. A sample is used if z' P z > c (1 - beta), see `step`."""


def step(
    parameters: ConditionalParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Update theta and P by recursive least squares if the sample has enough information.

    The condition is z' P z > c (1 - beta), where c is the threshold and beta is the forgetting
    factor. If the condition is false, theta and P do not change, and `held` is set to True.

    z contains the scaled regressors s_i phi_i, where s_i is the initial standard deviation of
    parameter i. P is the covariance of the scaled parameters theta_i / s_i, see `ud_factors`.
    """
    beta = forgetting_factor(parameters, state, dt)
    if predicted_variance(parameters, state, phi) > parameters.c * (1.0 - beta):
        update_and_forget(parameters, state, phi, f, dt, beta)
    else:
        state.held = True


class ConditionalUpdate(FactoredEstimator):
    """Recursive least squares that uses a sample only if the sample has enough information.

    A sample is used if phi' P phi exceeds c (1 - beta). phi contains the regressors, P is the
    covariance of the parameters, beta is the forgetting factor, and c is the threshold. phi' P phi
    is the variance of the predicted force phi' theta, relative to the noise variance. Other samples
    cause neither an update nor forgetting, so that P does not increase without limit at rest
    (K. J. Astrom and B. Wittenmark, "Adaptive Control", 2nd edition, Addison-Wesley, 1995, chapter
    11, where c = 2).

    The average of phi' P phi is m (1 - beta) if all m regressors are excited. It is 1 - beta while
    x is constant and v = 0. So c should be between 1 and m. If a motion is much smaller than the
    motion before it, its samples are not used.

    Parameters
    ----------
    forgetting, initial_covariance
        As in `RecursiveLeastSquares`.
    sample_period
        Time [s] in which forgetting multiplies the weight of a past sample by beta. There is
        forgetting only at the samples that are used. Default: each used sample multiplies the
        weights of the past samples by beta, independent of `dt`.
    threshold
        Threshold c, >= 0.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameter_type = ConditionalParameters

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        threshold: float = 2.0,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        if not 0.0 <= threshold < math.inf:
            raise ValueError(f"threshold must be >= 0 and finite, got {threshold}")
        super().__init__(
            forgetting, initial_covariance, sample_period, model, correlation, c=threshold
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            settings.forgetting**FORGETTING,
            settings.covariance,
            settings.sample_period,
            THRESHOLD,
            settings.model,
            settings.correlation,
        )
