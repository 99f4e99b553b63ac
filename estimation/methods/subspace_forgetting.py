"""Recursive least squares that forgets only in the subspace of new information (SIFt-RLS)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add,
    correct_with_gain,
    forgetting_factor,
    update_covariance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

LEAST = 1e-100
"""Lower limit of `SubspaceParameters.epsilon`."""


@dataclass(frozen=True, slots=True)
class SubspaceParameters(FactoredParameters):
    """Constant settings of the estimator `SubspaceForgetting`."""

    epsilon: float
    """Square of the setting `threshold`. A sample is used if z' z is at least this value, with the
    scaled regressors z."""


def scale(parameters: SubspaceParameters, state: FactoredState, phi: Regressors) -> float:
    """Compute the scaled regressors z_i = s_i phi_i, store them in `state.y`, and return z' z.

    s_i is the square root of the initial variance of parameter i.
    """
    s, y = parameters.s, state.y
    square = 0.0
    for i in below[len(phi)]:
        z = s[i] * phi[i]
        y[i] = z
        square += z * z
    return square


def information(state: FactoredState) -> float:
    """Return z' P^-1 z, where z is the vector of scaled regressors in `state.y`.

    P is the covariance of the scaled parameters. It is stored as factors, P = U D U'. So the result
    is computed as |D^-1/2 U^-1 z|^2. The function uses `state.L` as work space.
    """
    U, D, y, L = state.U, state.D, state.y, state.L
    m = len(D)
    total = 0.0
    for n in below[m]:
        i = m - 1 - n
        value = y[i]
        for later in below[n]:
            j = i + 1 + later
            value -= U[j][i] * L[j]
        L[i] = value
        total += value * value / D[i]
    return total


def step(
    parameters: SubspaceParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Process one sample: forget old information, add the new information, and update theta.

    P is the covariance of the scaled parameters theta_i / s_i, and R = P^-1 is the information
    matrix. z contains the scaled regressors s_i phi_i. s_i is the square root of the initial
    variance of parameter i. There are three operations:

    1. Old information is forgotten in the direction of z, with the forgetting factor beta:
       R <- R - (1 - beta) R z z' R / (z' R z). For P, this is
       P <- P + ((1 - beta) / beta) z z' / (z' R z).
    2. The information of the sample is added: R <- R + z z'.
    3. theta is corrected with the gain P z and the force error f - phi' theta. P is the covariance
       after the second operation.

    If |z| is below the threshold, theta and P do not change.
    """
    if scale(parameters, state, phi) < parameters.epsilon:
        state.held = True
    else:
        beta = forgetting_factor(parameters, state, dt)
        add(state, (1.0 - beta) / (beta * information(state)), len(phi))
        spread = update_covariance(parameters, state, phi, 1.0)
        correct_with_gain(parameters, state, phi, f, dt, spread)


class SubspaceForgetting(FactoredEstimator):
    """Recursive least squares that forgets only in the subspace of new information (SIFt-RLS).

    The regressors phi of a sample are a vector. A sample contains information about the parameters
    theta only in one direction. So old information is forgotten only in this direction.
    Samples with small regressors are ignored, see `threshold`.

    For every motion, the covariance P of theta has a positive lower bound and an upper bound. The
    upper bound is P0, the initial value of P, multiplied by 1 or by (1 - beta) / threshold^2,
    whichever is larger.

    The algorithm is applied to scaled parameters theta_i / s_i and scaled regressors s_i phi_i.
    s_i^2 is the initial variance of parameter i. The reason is that the algorithm adds squares of
    regressors of different units: its estimates would depend on the units of b and k. With the
    information matrix R = P^-1 of the parameters without scaling, the forgetting is

        R <- R - (1 - beta) R P0 phi phi' P0 R / (phi' P0 R P0 phi).

    So old information is forgotten in the direction P0 phi. Without the scaling, P0 would be the
    identity matrix. The estimates are those of the publication only if all initial variances are 1.

    The method is Algorithm 1 of B. Lai and D. S. Bernstein, "SIFt-RLS: Subspace of Information
    Forgetting Recursive Least Squares", arXiv:2404.10844, 2024, for one measurement per sample. The
    forgetting is the method of L. Cao and H. Schwartz, "A directional forgetting algorithm based on
    the decomposition of the information matrix", Automatica 36(11), 1725-1731, 2000.

    Parameters
    ----------
    forgetting, initial_covariance
        As in `RecursiveLeastSquares`.
    sample_period
        Time [s] in which the information in the direction of phi is multiplied by beta, so that
        the forgetting does not depend on the sampling rate. Default: the information is multiplied
        by beta at each sample, independent of `dt`.
    threshold
        A sample is used if sqrt(phi' P0 phi) is at least this threshold. This root is the standard
        deviation of the force phi' theta for a theta with the covariance P0, divided by the
        standard deviation of the noise. Lai and Bernstein call the threshold sqrt(epsilon).
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameter_type = SubspaceParameters

    def __init__(
        self,
        forgetting: float,
        initial_covariance: tuple[float, ...],
        sample_period: float | None = None,
        threshold: float = 1.0,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        if not 0.0 < threshold < math.inf:
            raise ValueError(f"threshold must be positive and finite, got {threshold}")
        super().__init__(
            forgetting,
            initial_covariance,
            sample_period,
            model,
            correlation,
            epsilon=max(threshold * threshold, LEAST),
        )
