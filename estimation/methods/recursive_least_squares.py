"""Recursive least squares with exponential forgetting (RLS)."""

from __future__ import annotations

from typing import Self

from estimation.method_settings import SIZES, MethodSettings
from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    correct_with_gain,
    forgetting_factor,
    update_covariance,
)
from estimation.step import Regressors, below


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Process one sample with the equations of recursive least squares.

    With the forgetting factor beta for the time `dt`, the gain L and the covariance P are

        L = P z / (beta + z' P z),    P <- (P - L z' P) / beta.

    Then the parameters theta are corrected with L and the force error f - phi' theta. P is the
    covariance of the scaled parameters theta_i / s_i, and z contains the scaled regressors
    s_i phi_i. s_i is the square root of the initial variance of parameter i.
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
    """Update the parameters theta and their covariance P with a sample, by recursive least squares.

    `beta` is the forgetting factor. With z_i = s_i phi_i, the equations are

        L = P z / (beta + z' P z),    P <- (P - L z' P) / beta,
        theta_i <- theta_i + s_i L_i (f - phi' theta).

    P is the covariance of the scaled parameters theta_i / s_i. s_i is the square root of the
    initial variance of parameter i. P is stored as U-D factors.
    """
    D = state.D
    spread = update_covariance(parameters, state, phi, beta)
    growth = 1.0 / beta
    for j in below[len(phi)]:
        D[j] *= growth
    correct_with_gain(parameters, state, phi, f, dt, spread)


class RecursiveLeastSquares(FactoredEstimator):
    """Recursive least squares with exponential forgetting.

    The method is given by equations (3) and (4) of T. Yamamoto et al., "Techniques for environment
    parameter estimation during telemanipulation", BioRob 2008. After N samples, the estimate theta
    minimises

        sum_n beta^(N-n) (f_n - phi_n' theta)^2 + beta^N theta' P0^-1 theta,

    where f_n is the force and phi_n contains the regressors of sample n.

    Without motion, old information is forgotten but no information is added. The covariance P then
    increases by the factor 1/beta per sample. If `sample_period` is given and samples are missing,
    the whole increase for the missing time occurs at the next sample. The increase ends when a
    variance is 10^10 times its initial value (`WINDUP`). In recordings with motion, the variances
    remain below this limit. P is stored as U-D factors, P = U D U', so that P remains positive
    definite and its rounding errors are small.

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
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).
    guess_variance
        Variances of the error of the initial guess theta = 0, in the units of
        `initial_covariance`. They have an effect only on the standard deviations of the estimates.
        Give these variances if they are larger than `initial_covariance`. Default:
        `initial_covariance`.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    gated = False
    used_settings = ("forgetting", "initial_covariance", *SIZES)

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        # initial_covariance as in the paper; it has no values for the parameters besides b and k
        return cls(
            settings.forgetting,
            (*settings.initial_covariance, *settings.covariance[2:]),
            settings.sample_period,
            settings.model,
            settings.correlation,
            guess_variance=settings.covariance,
        )
