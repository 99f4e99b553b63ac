"""Adaptive identification (AI): estimate b and k by a gradient law."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Self

from estimation.checks import positive_values
from estimation.estimator import Estimates
from estimation.linear_gain import (
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.method_settings import SIZES, MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below

RK4_LIMIT = 2.785293563405282
"""Stability limit of z = r dt if y' = -r y is integrated by Runge-Kutta 4 (RK4).

This is the root of |1 - z + z^2/2 - z^3/6 + z^4/24| = 1.
"""

GUESS = 1.0
"""Initial variance of a parameter, divided by the adaptation gain of the parameter [s].

The initial variance affects only the standard deviations. It is for force noise with a variance of
1 N^2.
"""


@dataclass(frozen=True, slots=True)
class GradientParameters(LinearGainParameters):
    """Constant settings of the estimator `AdaptiveIdentification`, which `step` reads."""

    rk4: bool
    """Whether the gradient law is integrated by Runge-Kutta 4 (RK4) if RK4 is stable."""
    Gamma: tuple[float, ...]
    """Diagonal of the adaptation gain Gamma, (m,)."""


@dataclass(slots=True)
class GradientState(LinearGainState):
    """Variables of `AdaptiveIdentification`, which the function `step` updates at each sample."""

    beyond_rk4: int
    """Number of samples for which Runge-Kutta 4 (RK4) was unstable."""


def step(
    parameters: GradientParameters, state: GradientState, phi: Regressors, f: float, dt: float
) -> None:
    """Integrate the gradient law over one sample period, in which phi and f are constant.

    The gradient law is d theta / dt = -Gamma phi e, where Gamma is the adaptation gain and
    e = phi' theta - f is the force error (equation (8) of the paper). So the force error decays as
    de/dt = -r e with r = phi' Gamma phi. In a sample period `dt` that starts with the force error
    e, theta changes by exactly -Gamma phi e (1 - exp(-z)) / r, where z = r dt. The Runge-Kutta 4
    method replaces exp(-z) by its Taylor series up to z^4.
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
    """Adaptive identification of the parameters theta of a model f = phi' theta by a gradient law.

    The gradient law is d theta / dt = -Gamma phi (phi' theta - f). phi contains the regressors, and
    Gamma is the adaptation gain. The source is the paper (Yamamoto et al., 2008), equations (5) to
    (8).

    Parameters
    ----------
    gain
        Diagonal of Gamma, one value per parameter of the model: first b [s/m^2], then
        k [1/(s m^2)], then any further parameters.
    method
        Method by which the gradient law is integrated over a sample period:

        - `rk4`: Runge-Kutta 4 (RK4) as in the paper. RK4 is unstable for a sample with
          phi' Gamma phi dt > 2.785. For such a sample, the exact solution is used instead, and
          `beyond_rk4` increases by 1. For example, with the gain that the paper uses for the hard
          cube and a sample rate of 1 kHz, RK4 is unstable for displacements above 17 mm.
        - `exact`: the closed-form solution, which is stable for every gain and every `dt`.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        A gain is not positive, the method is unknown, or `correlation` is below 1.
    """

    step = staticmethod(step)
    gated = False
    used_settings = ("adaptation_gain", "ai_method", *SIZES)
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

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        # the paper has no gains for parameters besides b and k
        further = (4.0 / (settings.memory * size**2) for size in settings.sizes[2:])
        return cls(
            (*settings.adaptation_gain, *further),
            settings.ai_method,
            settings.model,
            settings.correlation,
        )

    @property
    def beyond_rk4(self) -> int:
        """Number of samples for which Runge-Kutta 4 (RK4) was unstable.

        For these samples, the exact solution of the gradient law was used.
        """
        return self.state.beyond_rk4

    def note(self, estimates: Estimates) -> str | None:
        """Return a note if Runge-Kutta 4 (RK4) was unstable for some samples; None otherwise.

        The note contains the number of these samples. For these samples, the exact solution of the
        gradient law was used instead. The argument `estimates` is not used.
        """
        if self.beyond_rk4:
            return (
                f"RK4 is unstable in {self.beyond_rk4} samples; the exact solution was used there"
            )
        return None
