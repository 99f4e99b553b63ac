"""Adaptive identification by the gradient law (AI)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from estimation.checks import positive_values
from estimation.estimator import Estimates
from estimation.linear_gain import (
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

RK4_LIMIT = 2.785293563405282
"""RK4 of y' = -r y diverges beyond this r dt: the root of |1 - z + z^2/2 - z^3/6 + z^4/24| = 1."""

GUESS = 1.0
"""Variance of the first guess, as `LinearGainEstimator` takes it, by gain [s]."""


@dataclass(frozen=True, slots=True)
class GradientParameters(LinearGainParameters):
    """Parameters of `step`."""

    rk4: bool
    """Whether (8) is integrated by Runge-Kutta 4 where that is stable."""
    Gamma: tuple[float, ...]
    """Diagonal of the adaptation gain, (m,)."""


@dataclass(slots=True)
class GradientState(LinearGainState):
    """State of `step`."""

    beyond_rk4: int
    """How many samples RK4 would have diverged on."""


def step(
    parameters: GradientParameters, state: GradientState, phi: Regressors, f: float, dt: float
) -> None:
    """(8) over one period with phi and f held, where it is a flow of rank one.

    The force error decays along it as Delta f' = -r Delta f, r = phi' Gamma phi, so that
    theta moves by -Gamma phi Delta f times the integral of the decay: (1 - e^-z) / r with
    z = r dt, or what the four stages of RK4 make of it, its Taylor series to z^4.
    """
    Gamma, L = parameters.Gamma, state.L
    rate = 0.0
    for i in below[len(phi)]:
        L[i] = Gamma[i] * phi[i]
        rate += phi[i] * L[i]
    z = rate * dt
    if parameters.rk4 and z <= RK4_LIMIT:
        held = dt * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0)))
    else:
        held = -math.expm1(-z) / rate if rate > 0.0 else dt
        if parameters.rk4:
            state.beyond_rk4 += 1
    for i in below[len(phi)]:
        L[i] *= held
    correct(parameters, state, phi, f, dt)


class AdaptiveIdentification(LinearGainEstimator):
    """Adaptive identification by the gradient law, the paper's (5)-(8).

    Parameters
    ----------
    gain
        Diagonal of Gamma, for b, k and what else the model has.
    method
        How (8) is integrated over a sample period:

        - `rk4`: Runge-Kutta 4 as in the paper, while it is stable. RK4 diverges once
          phi' Gamma phi dt > 2.785; such a sample is taken exactly instead, and counted
          in `beyond_rk4`. The paper's gain for the hard cube gets there at 1 kHz with
          17 mm of displacement.
        - `exact`: the closed form, stable for every gain and every `dt`.
    model
        The regressors.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A gain is not positive or the method is unknown.
    """

    step = staticmethod(step)
    gated = False
    state: GradientState

    def __init__(
        self,
        gain: tuple[float, ...],
        method: Literal["rk4", "exact"] = "exact",
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        gain = positive_values("adaptation gain", gain, model)
        if method not in ("rk4", "exact"):
            raise ValueError(f"method must be 'rk4' or 'exact', got {method!r}")
        guess_variance = [GUESS * value for value in gain]
        super().__init__(
            GradientParameters(correlation, method == "rk4", gain),
            GradientState(**linear_gain_state(guess_variance), beyond_rk4=0),
            model,
        )

    @property
    def beyond_rk4(self) -> int:
        """How many samples RK4 would have diverged on and the exact update was taken instead."""
        return self.state.beyond_rk4

    def note(self, estimates: Estimates) -> str | None:
        """Whether RK4 was left for the exact update."""
        if self.beyond_rk4:
            return f"past RK4's stability limit in {self.beyond_rk4} samples, taken exactly instead"
        return None
