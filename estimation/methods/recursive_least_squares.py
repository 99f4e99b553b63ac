"""Recursive least squares with exponential forgetting (RLS)."""

from __future__ import annotations

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    kept,
    learn,
    take_in,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """(3)-(4): L = P z / (beta + z' P z), P <- (P - L z' P) / beta."""
    take_in_and_forget(parameters, state, phi, f, dt, kept(parameters, state, dt))


def take_in_and_forget(
    parameters: FactoredParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
    beta: float,
) -> None:
    """(3)-(4) with a forgetting factor beta."""
    D = state.D
    spread = take_in(parameters, state, phi, beta)
    growth = 1.0 / beta
    for j in below[len(phi)]:
        D[j] *= growth
    learn(parameters, state, phi, f, dt, spread)


class RecursiveLeastSquares(FactoredEstimator):
    """Recursive least squares with exponential forgetting, the paper's (3)-(4), by U-D factors.

    Minimises sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta.

    Without motion nothing is learned while forgetting goes on, and the covariance grows by
    1/beta a sample, or at once over a gap in the data. It grows no further once a variance is
    `WINDUP` times its initial value; a recording with motion does not come near. Kept as U-D
    factors it stays positive definite meanwhile, and keeps its digits where double precision
    gives out for P itself.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which a sample's weight falls by beta. Given it, forgetting honours a
        varying `dt`; without, a weight falls by beta each sample whatever the `dt`.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.
    guess_variance
        Variance of the first guess, zero, that the interval begins with, in the units of
        the initial covariance, where that is smaller than the guess deserves.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    step = staticmethod(step)
    gated = False

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
        guess_variance: tuple[float, ...] | None = None,
    ) -> None:
        super().__init__(
            forgetting, initial_covariance, sample_period, model, correlation, guess_variance
        )
