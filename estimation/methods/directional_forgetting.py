"""Recursive least squares with forgetting only in the direction of the present sample."""

from __future__ import annotations

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add,
    correct_with_gain,
    forgetting_factor,
    predicted_variance,
    update_covariance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

NO_NEWS = 1e-100
"""If z' P z is smaller than this, no information is forgotten.

The reason is that 1 / (z' P z), a factor of the forgetting, could overflow.
"""


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Set P^-1 <- P^-1 + (beta - (1 - beta) / r) z z' with r = z' P z, and update theta.

    z contains the scaled regressors (`ud_factors`), and beta is the forgetting factor. The gain is
    P z / (1 + r). P is updated in two steps. First, P is updated without forgetting. Second, with
    this new P, the forgetting is P <- P + (1 - beta) / beta P z z' P / (z' P z). The added term is
    positive.
    """
    m = len(phi)
    beta = forgetting_factor(parameters, state, dt)
    r = predicted_variance(parameters, state, phi)
    spread = update_covariance(parameters, state, phi, 1.0)
    if r > NO_NEWS:
        y, L = state.y, state.L
        for i in below[m]:
            y[i] = L[i]
        add(state, (1.0 - beta) / (beta * r * spread), m)
    correct_with_gain(parameters, state, phi, f, dt, spread)


class DirectionalForgetting(FactoredEstimator):
    """Recursive least squares with directional forgetting.

    Information is forgotten only in the direction of the present regressors phi. So the covariance
    does not wind up in directions without excitation, or while phi = 0. If the direction of phi is
    constant, phi' P phi converges to (1 - beta) / beta. This limit does not depend on the magnitude
    of phi. So the noise of x and v at rest has the same effect as motion.

    The method is from R. Kulhavy and M. Karny, "Tracking of slowly varying parameters by
    directional forgetting", 9th IFAC World Congress, Budapest, 1984, IFAC Proceedings Volumes
    17(2), 687-692. R. Kulhavy and M. B. Zarrop, "On a general concept of forgetting", International
    Journal of Control 58(4), 905-924, 1993, describe it as a case of a general method.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0: the initial variances of b [(N s/m)^2], k [(N/m)^2] and any further
        parameters of the model, for force noise with a variance of 1 N^2.
    sample_period
        Time [s] in which the information in the direction of phi is multiplied by beta, so that
        the forgetting does not depend on the sampling rate.
        Default: the information is multiplied by beta at each sample, independent of `dt`.
    model
        Model that defines the regressors.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        super().__init__(forgetting, initial_covariance, sample_period, model, correlation)
