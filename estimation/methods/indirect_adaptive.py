"""Gradient estimator that is used in indirect adaptive force control (IAC)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.checks import positive_values
from estimation.linear_gain import (
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below


@dataclass(frozen=True, slots=True)
class IndirectParameters(LinearGainParameters):
    """Constant settings of the function `step`."""

    rate: float
    """Rate at which the force error decays [1/s]."""
    floor: float
    """The rate is halved at this value of s' s, with s_i = phi_i / size_i."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


def step(
    parameters: IndirectParameters,
    state: LinearGainState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Integrate the normalised gradient law over one sample period with constant phi and f.

    With s_i = phi_i / size_i and G = diag(1 / size_i^2),

        theta' = rate G phi (f - phi' theta) / (floor + s' s).

    The force error f - phi' theta then decays at the rate `rate` s' s / (floor + s' s).
    """
    per_size, L = parameters.per_size, state.L
    square = 0.0
    for i in below[len(phi)]:
        s = phi[i] * per_size[i]
        L[i] = s * per_size[i]
        square += s * s
    speed = parameters.rate / (parameters.floor + square)
    held = -math.expm1(-speed * square * dt) / square if square > 0.0 else speed * dt
    for i in below[len(phi)]:
        L[i] *= held
    correct(parameters, state, phi, f, dt)


class IndirectAdaptive(LinearGainEstimator):
    """Estimator of the indirect adaptive force control of Seraji and Colbaugh.

    H. Seraji and R. Colbaugh, "Force tracking in impedance control", International Journal of
    Robotics Research, 1997, adapt k and f0 by a Lyapunov gradient law until the predicted force
    k x + f0 is equal to the measured force. The surface is at x_e = -f0 / k. For the desired force
    f_r, they compute the reference position x_r = x_e + f_r / k. D. Erickson, M. Weber and
    I. Sharf, "Contact stiffness and damping estimation for robotic systems", International Journal
    of Robotics Research, 2003, predict the force by b v + k x. They estimate the damping b, but not
    the position of the surface.

    This class contains only the estimator, without the impedance controller. By default, it is the
    estimator of Erickson et al. With the model `datum`, the class estimates b, k and f0. It differs
    from the published estimators in two points. First, the gain is normalised by s' s, with
    s_i = phi_i / size_i. So one rate is suitable for every depth and every specimen. Second, the
    gradient law is solved exactly over a sample period. The exact solution is stable for every rate
    and every `dt`.

    A gradient method cannot converge faster than the direction of phi changes. So a rate above the
    angular frequency of the motion has no advantage.

    Parameters
    ----------
    rate
        Rate [1/s] at which the force error decays.
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. The ratios of these
        values determine the relative adaptation gains of the parameters.
    floor
        The rate is halved at this value of s' s. Samples with a smaller s' s have little effect.
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
        rate: float,
        sizes: tuple[float, ...],
        floor: float = 0.02,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        for name, value in (("rate", rate), ("floor", floor)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        guess_variance = [scale * scale for scale in per_size]
        super().__init__(
            IndirectParameters(correlation, rate, floor, per_size),
            LinearGainState(**linear_gain_state(guess_variance)),
            model,
        )
