"""Recursive least squares with forgetting only in the direction of the present regressors."""

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
from estimation.step import Regressors, below

NO_NEWS = 1e-100
"""If z' P z is smaller than this, no information is forgotten.

The forgetting contains the factor 1 / (z' P z), which could then overflow.
"""


def step(
    parameters: FactoredParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Update the covariance P with directional forgetting, and update theta.

    The update is P^-1 <- P^-1 + (beta - (1 - beta) / r) z z', where r = z' P z and beta is the
    forgetting factor. It is computed in two steps:

    1. P <- P - P z z' P / (1 + r), the update without forgetting.
    2. P <- P + (1 - beta) / beta P z z' P / (z' P z), the forgetting. Here P is the result of step
       1. The added term is positive semidefinite.

    theta is updated with the gain P z / (1 + r), where P is the covariance before this sample.

    z contains the scaled regressors s_i phi_i, where s_i is the initial standard deviation of
    parameter i. P is the covariance of the scaled parameters theta_i / s_i, see `ud_factors`.
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
    P does not increase without limit in directions without excitation, or while phi = 0. If the
    direction of phi is constant, phi' P phi converges to (1 - beta) / beta. This limit does not
    depend on the magnitude of phi. So at rest, the noise of x and v has the same effect as motion.

    The method is from R. Kulhavy and M. Karny, "Tracking of slowly varying parameters by
    directional forgetting", 9th IFAC World Congress, Budapest, 1984, IFAC Proceedings Volumes
    17(2), 687-692. R. Kulhavy and M. B. Zarrop, "On a general concept of forgetting", International
    Journal of Control 58(4), 905-924, 1993, describe it as a case of a general method.

    Parameters
    ----------
    forgetting, initial_covariance
        As in `RecursiveLeastSquares`.
    sample_period
        Time [s] in which the information in the direction of phi is multiplied by beta. The
        forgetting then does not depend on the sampling rate. Default: the information is multiplied
        by beta at each sample, independent of `dt`.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
