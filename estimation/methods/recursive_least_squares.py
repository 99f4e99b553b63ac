"""Recursive least squares with exponential forgetting (RLS)."""

from __future__ import annotations

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    correct_with_gain,
    forgetting_factor,
    update_covariance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Update by (3)-(4): L = P z / (beta + z' P z), P <- (P - L z' P) / beta."""
    update_and_forget(parameters, state, phi, f, dt, forgetting_factor(parameters, state, dt))


def update_and_forget(
    parameters: FactoredParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
    beta: float,
) -> None:
    """Update by (3)-(4) with a forgetting factor beta."""
    D = state.D
    spread = update_covariance(parameters, state, phi, beta)
    growth = 1.0 / beta
    for j in below[len(phi)]:
        D[j] *= growth
    correct_with_gain(parameters, state, phi, f, dt, spread)


class RecursiveLeastSquares(FactoredEstimator):
    """Recursive least squares with exponential forgetting, the paper's (3)-(4).

    The estimate minimises sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta.

    Without motion, old information is forgotten but none is added: the covariance grows by the
    factor 1/beta per sample, or in one step over a gap in the data. It stops growing when a
    variance is `WINDUP` times its initial value, which recordings with motion do not reach. The
    covariance is stored as U-D factors. So it stays positive definite, and keeps its precision
    where P itself would lose it in double precision.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0: the initial variances of b [(N s/m)^2], k [(N/m)^2] and any further
        parameters of the model, for force noise with a variance of 1 N^2.
    sample_period
        Time [s] over which a weight decreases by the factor beta, so that forgetting depends on
        `dt`. By default it decreases by beta with each sample, independent of `dt`.
    model
        Model that defines the regressors.
    correlation
        Number of samples per independent sample of the force noise, see `LinearGainEstimator`.
    guess_variance
        Variance of the initial guess theta = 0 that the intervals start with, in the units of
        the initial covariance. Use it if the initial covariance is too small for the error of
        this guess. Default: the initial covariance.

    Raises
    ------
    ValueError
        An argument is out of its range.
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
