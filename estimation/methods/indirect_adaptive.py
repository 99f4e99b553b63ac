"""The estimator of indirect adaptive force control (IAC)."""

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
    """Parameters of `step`."""

    rate: float
    """Rate at which the force error decays [1/s]."""
    floor: float
    """The s's at which the rate is half as high."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


def step(
    parameters: IndirectParameters,
    state: LinearGainState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """The normalised gradient law over one period with phi and f held.

    With s_i = phi_i / size_i and G = diag(1 / size_i^2),

        theta' = rate G phi (f - phi' theta) / (floor + s's).

    The force error decays along it at the rate `rate` s's / (floor + s's).
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
    """The estimator of Seraji and Colbaugh's indirect adaptive force control.

    H. Seraji and R. Colbaugh, "Force tracking in impedance control", International Journal of
    Robotics Research, 1997, let the predicted force k x + f0 follow the measured one by a
    Lyapunov gradient law, and set the reference position x_r = x_e + f_r / k from the
    stiffness and the surface's location x_e = -f0 / k. D. Erickson, M. Weber and I. Sharf,
    "Contact stiffness and damping estimation for robotic systems", International Journal of
    Robotics Research, 2003, let it estimate damping in the location's place: b v + k x.

    Taken is the estimator, without the impedance controller that it steers: Erickson's by
    default, and with the model `datum` the damping and the location both. Added are the
    normalisation by s's, so that one rate serves every depth and cube, and the exact flow over
    a sample, so that no rate and no `dt` make it diverge.

    A gradient does not converge faster than phi turns: past a rate of about the motion's
    angular frequency a higher one gains nothing.

    Parameters
    ----------
    rate
        Rate [1/s] at which the force error decays.
    sizes
        Typical size (rms) of each regressor, [m/s] for v, [m] for x. Their ratios weigh the
        parameters against each other.
    floor
        The s's at which the rate is half as high: with less, little is learned.
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
