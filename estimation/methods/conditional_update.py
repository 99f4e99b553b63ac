"""Recursive least squares of the samples with news alone (conditional update)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.methods.recursive_least_squares import take_in_and_forget
from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    kept,
    predicted_variance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors


@dataclass(frozen=True, slots=True)
class ConditionalParameters(FactoredParameters):
    """Parameters of `step`."""

    c: float
    """A sample counts where z' P z > c (1 - beta)."""


def step(
    parameters: ConditionalParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Recursive least squares where z' P z > c (1 - beta); elsewhere nothing changes."""
    beta = kept(parameters, state, dt)
    if predicted_variance(parameters, state, phi) > parameters.c * (1.0 - beta):
        take_in_and_forget(parameters, state, phi, f, dt, beta)
    else:
        state.held = True


class ConditionalUpdate(FactoredEstimator):
    """Recursive least squares of those samples alone that bring news.

    A sample is taken in where phi' P phi, the variance of the force that P predicts by that of
    the noise, exceeds c (1 - beta). Elsewhere nothing is learned and nothing forgotten, so
    that rest does not wind P up (K. J. Astrom and B. Wittenmark, "Adaptive Control", 2nd
    edition, Addison-Wesley, 1995, chapter 11, where c = 2). With forgetting, m regressors that
    all move bring m (1 - beta) on average and a probe at rest 1 - beta, so c belongs between 1
    and m. Motion much smaller than what came before it is no news.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which the weight of a sample falls by beta, as long as samples are
        taken in; without, it falls by beta with each such sample whatever the `dt`.
    threshold
        c, >= 0.
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
