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
    """Update theta by (3)-(4) of the paper: L = P z / (beta + z' P z), P <- (P - L z' P) / beta.

    z contains the scaled regressors (`ud_factors`).
    """
    update_and_forget(parameters, state, phi, f, dt, forgetting_factor(parameters, state, dt))


def update_and_forget(
    parameters: FactoredParameters,
    state: FactoredState,
    phi: Regressors,
    f: float,
    dt: float,
    beta: float,
) -> None:
    """Update theta and P by (3)-(4) of the paper, with the forgetting factor beta."""
    D = state.D
    spread = update_covariance(parameters, state, phi, beta)
    growth = 1.0 / beta
    for j in below[len(phi)]:
        D[j] *= growth
    correct_with_gain(parameters, state, phi, f, dt, spread)


class RecursiveLeastSquares(FactoredEstimator):
    """Recursive least squares with exponential forgetting, equations (3) and (4) of the paper.

    After N samples, the estimate minimises

        sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta.

    Without motion, old information is forgotten but no information is added. The covariance then
    increases by the factor 1/beta per sample. Over a gap in the data, the whole increase occurs in
    one step. The increase ends when a variance is `WINDUP` times its initial value. In recordings
    with motion, the variances remain below this limit. The covariance is stored as U-D factors, so
    that it remains positive definite and its rounding errors are small.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0: the initial variances of b [(N s/m)^2], k [(N/m)^2] and any further
        parameters of the model, for force noise with a variance of 1 N^2.
    sample_period
        Time [s] in which the weight of a past sample is multiplied by beta. Forgetting then depends
        on `dt`. Default: the weight is multiplied by beta at each sample, independent of `dt`.
    model
        Model that defines the regressors.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.
    guess_variance
        Variances of the error of the initial guess theta = 0, in the units of the initial
        covariance. They have an effect only on the standard deviations. Give these variances if
        they are larger than the initial covariance. Default: the initial covariance.

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
