"""Subspace of information forgetting recursive least squares (SIFt-RLS)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add,
    kept,
    learn,
    take_in,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

LEAST = 1e-100
"""Least square of a threshold."""


@dataclass(frozen=True, slots=True)
class SubspaceParameters(FactoredParameters):
    """Parameters of `step`."""

    epsilon: float
    """Least z' z of a sample that counts."""


def scale(parameters: SubspaceParameters, state: FactoredState, phi: Regressors) -> float:
    """Make y the scaled regressors z; return z' z."""
    s, y = parameters.s, state.y
    square = 0.0
    for i in below[len(phi)]:
        z = s[i] * phi[i]
        y[i] = z
        square += z * z
    return square


def information(state: FactoredState) -> float:
    """Z' P^-1 z = |D^-1/2 U^-1 z|^2, with y = z; overwrites the gain."""
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
    """With R = P^-1, R <- R - (1 - beta) R z z' R / z' R z + z z'; gain P z, P the new one.

    The forgetting is P <- P + (1 - beta) / beta z z' / z' R z. Where |z| is below the threshold,
    nothing changes.
    """
    if scale(parameters, state, phi) < parameters.epsilon:
        state.held = True
    else:
        beta = kept(parameters, state, dt)
        add(state, (1.0 - beta) / (beta * information(state)), len(phi))
        spread = take_in(parameters, state, phi, 1.0)
        learn(parameters, state, phi, f, dt, spread)


class SubspaceForgetting(FactoredEstimator):
    """Recursive least squares that forgets in the subspace of the sample's information, SIFt-RLS.

    Information on a direction is forgotten only as new information on it comes, and a sample
    too small to count is filtered out (B. Lai and D. S. Bernstein, "SIFt-RLS: Subspace of
    Information Forgetting Recursive Least Squares", arXiv:2404.10844, 2024, its Algorithm 1
    for one measurement a sample; the forgetting is that of L. Cao and H. Schwartz, "A
    directional forgetting algorithm based on the decomposition of the information matrix",
    Automatica 36(11), 1725-1731, 2000). P is bounded below and above whatever the motion: it
    never exceeds P0 by more than (1 - beta) / threshold^2, if that is above 1.

    Parameters
    ----------
    forgetting
        The forgetting factor beta, 0 < beta <= 1.
    initial_covariance
        Diagonal of P0, for b [(N s/m)^2] and k [(N/m)^2] and what else the model has, per N^2
        of force variance.
    sample_period
        Time [s] over which the information in a sample's direction falls by beta; without,
        it does so each sample whatever the `dt`.
    threshold
        Least sqrt(phi' P0 phi) of a sample that counts: the deviation of the force that the
        first guess predicts, by that of the noise. The paper's sqrt(epsilon).
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
