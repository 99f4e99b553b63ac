"""Adaptive identification by the gradient law (AI)."""

from __future__ import annotations

import math
from typing import Literal

from estimation.compiled import State
from estimation.estimator import Estimates, Estimator, positive_pair

RK4_LIMIT = 2.785293563405282
"""RK4 of y' = -r y diverges beyond this r dt: the root of |1 - z + z^2/2 - z^3/6 + z^4/24| = 1."""


def step(parameters: State, state: State, v: float, x: float, f: float, dt: float) -> State:
    """(8) over one period with phi = [v, x] and f held, where it is a flow of rank one.

    The force error decays along it as Delta f' = -r Delta f, r = phi' Gamma phi, so that
    theta moves by -Gamma phi Delta f times the integral of the decay: (1 - e^-z) / r with
    z = r dt, or what the four stages of RK4 make of it, its Taylor series to z^4.
    """
    gain_b, gain_k, rk4 = parameters
    b, k, beyond = state
    rate = gain_b * v * v + gain_k * x * x
    z = rate * dt
    if rk4 > 0.0 and z <= RK4_LIMIT:
        held = dt * (1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0)))
    else:
        held = -math.expm1(-z) / rate if rate > 0.0 else dt
        beyond += rk4
    held_error = held * (b * v + k * x - f)
    return b - gain_b * v * held_error, k - gain_k * x * held_error, beyond


class AdaptiveIdentification(Estimator):
    """Adaptive identification by the gradient law, the paper's (5)-(8).

    Parameters
    ----------
    gain
        Diagonal of Gamma, for b and for k.
    method
        How (8) is integrated over a sample period:

        - `rk4`: Runge-Kutta 4 as in the paper, while it is stable. RK4 diverges once
          phi' Gamma phi dt > 2.785; such a sample is taken exactly instead, and counted
          in `beyond_rk4`. The paper's gain for the hard cube gets there at 1 kHz with
          17 mm of displacement.
        - `exact`: the closed form, stable for every gain and every `dt`.

    Raises
    ------
    ValueError
        A gain is not positive or the method is unknown.
    """

    step = staticmethod(step)

    def __init__(
        self, gain: tuple[float, float], method: Literal["rk4", "exact"] = "exact"
    ) -> None:
        gain_b, gain_k = positive_pair("adaptation gain", gain)
        if method not in ("rk4", "exact"):
            raise ValueError(f"method must be 'rk4' or 'exact', got {method!r}")
        super().__init__((gain_b, gain_k, float(method == "rk4")), (0.0, 0.0, 0.0))

    @property
    def beyond_rk4(self) -> int:
        """How many samples RK4 would have diverged on and the exact update was taken instead."""
        return int(self.state[2])

    def note(self, estimates: Estimates) -> str | None:
        """Whether RK4 was left for the exact update."""
        if self.beyond_rk4:
            return f"past RK4's stability limit in {self.beyond_rk4} samples, taken exactly instead"
        return None
