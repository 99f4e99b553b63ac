"""Adaptive identification by a gradient method with a normalised gain (NAI)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from estimation.checks import check_positive, positive_values
from estimation.linear_gain import (
    LinearGainEstimator,
    LinearGainParameters,
    LinearGainState,
    correct,
    linear_gain_state,
)
from estimation.method_settings import SIZES, MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, Vector, below

LEAST = 0.1
"""Lower limit of the mean square of a regressor, divided by the typical mean square."""
MOST = 100.0
"""Upper limit of the square of a regressor, divided by the typical mean square."""
LARGEST_SHARE = 0.1
"""Largest weight of one sample in a mean square, even after a long gap in the data."""
RATE = 0.55
"""Rate of `ai_normalised`, in units of 1 / memory.

The settling time (see `benchmarks/tuning.py`) is 0.59 s, and at least 0.50 s for all tested
multiples of this value. This method is a gradient method. It cannot converge faster than the ratio
of the regressors v and x changes.
"""


@dataclass(frozen=True, slots=True)
class NormalisedParameters(LinearGainParameters):
    """Constant settings of the estimator `NormalisedIdentification`."""

    rate: float
    """Rate at which the parameters converge [1/s]."""
    per_memory: float
    """1 / time constant of the mean squares of the regressors [1/s]."""
    per_size: tuple[float, ...]
    """1 / typical root mean square of each regressor, (m,)."""


@dataclass(slots=True)
class NormalisedState(LinearGainState):
    """Variables of the estimator `NormalisedIdentification` that change at each sample."""

    mean_square: Vector
    """Mean square of each regressor, divided by the typical mean square, (m,)."""


def step(
    parameters: NormalisedParameters,
    state: NormalisedState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Process one sample: integrate the gradient law over the time `dt` since the last sample.

    The gradient law for the parameters theta is

        d theta / dt = -Gamma phi (phi' theta - f).

    During `dt`, the regressors phi and the force f are taken as constant. Gamma is a diagonal
    matrix with the elements Gamma_i = rate / <phi_i^2>, where < > is a mean over time.
    """
    per_size, mean_square, L = parameters.per_size, state.mean_square, state.L
    share = parameters.per_memory * dt
    share = min(share / (1.0 + share), LARGEST_SHARE)
    speed = 0.0
    rate = parameters.rate
    for i in below[len(phi)]:
        scaled = phi[i] * per_size[i]
        square = scaled * scaled
        mean = mean_square[i]
        mean += share * ((square if square < MOST else MOST) - mean)
        mean_square[i] = mean
        adaptation = rate / (mean if mean > LEAST else LEAST)
        L[i] = adaptation * scaled * per_size[i]
        speed += adaptation * square
    held = -math.expm1(-speed * dt) / speed if speed > 0.0 else dt
    for i in below[len(phi)]:
        L[i] *= held
    correct(parameters, state, phi, f, dt)


class NormalisedIdentification(LinearGainEstimator):
    """Adaptive identification with a gain that is normalised by the mean square of each regressor.

    The model of the environment is f = phi' theta, with the regressors phi and the parameters
    theta; for example, phi = (v, x) and theta = (b, k). theta follows the gradient law

        d theta / dt = -Gamma phi (phi' theta - f).

    This is equation (8) of T. Yamamoto et al., "Techniques for environment parameter estimation
    during telemanipulation", BioRob 2008. In their method, the gain Gamma must be chosen for the
    specimen and for the depth of the indentation. Here, Gamma is a diagonal matrix with the
    elements Gamma_i = rate / <phi_i^2>, where < > is a mean over time. This is the normalised
    gradient method of P. A. Ioannou and J. Sun, "Robust Adaptive Control", 1996, section 4.3, but
    each regressor is normalised separately. So all parameters converge at the rate `rate` if the
    regressors are uncorrelated. This rate does not depend on the units or the magnitudes of the
    regressors.

    The gradient law is solved exactly over the time `dt` between two samples. The exact solution is
    stable for every rate and every `dt`.

    One sample changes theta only in the direction of Gamma phi. So the convergence of theta cannot
    be faster than the change of the direction of phi. A rate above half the angular frequency of
    the motion therefore has no advantage.

    Parameters
    ----------
    rate
        Rate [1/s] at which the parameters converge.
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. The order of magnitude
        is sufficient: the normalisation works for a mean square between 0.1 and 100 times the
        square of the typical value.
    memory
        Time constant [s] of the mean squares <phi_i^2>.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    used_settings = ("forgetting", *SIZES)

    def __init__(
        self,
        rate: float,
        sizes: tuple[float, ...],
        memory: float = 0.05,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        check_positive(rate=rate, memory=memory)
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        guess_variance = [scale * scale for scale in per_size]
        super().__init__(
            NormalisedParameters(correlation, rate, 1.0 / memory, per_size),
            NormalisedState(
                **linear_gain_state(guess_variance), mean_square=[1.0] * model.regressors
            ),
            model,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        memory = settings.memory
        return cls(RATE / memory, settings.sizes, memory, settings.model, settings.correlation)
