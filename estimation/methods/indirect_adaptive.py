"""Gradient estimator that is used in indirect adaptive force control (IAC)."""

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
from estimation.step import Regressors, below

RATE = 1.35
"""Rate of `indirect`, in units of 1 / memory.

The settling time (see `benchmarks/tuning.py`) is 0.64 s. It is 0.44 s for 0.8 times this value, and
longer than 0.64 s for 0.5 and 2 times this value.
"""


@dataclass(frozen=True, slots=True)
class IndirectParameters(LinearGainParameters):
    """Constant settings of the estimator `IndirectAdaptive`, which `step` reads."""

    rate: float
    """Rate [1/s] at which the force error decays if s' s is much larger than `floor`."""
    floor: float
    """Value of s' s, with s_i = phi_i / size_i, at which the decay rate is half of `rate`."""
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

    The gradient law is

        d theta / dt = rate G phi (f - phi' theta) / (floor + s' s)

    with the scaled regressors s_i = phi_i / size_i and the gain matrix G = diag(1 / size_i^2).
    `rate`, `floor` and the typical sizes size_i are settings. So the force error f - phi' theta
    decays at the rate [1/s] rate s' s / (floor + s' s).
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
    """Estimator from indirect adaptive force control, a normalised gradient method.

    Seraji and Colbaugh [1]_ adapt k and f0 by a Lyapunov gradient law until the predicted force
    k x + f0 is equal to the measured force. The surface of the specimen is then at x_e = -f0 / k.
    For the desired force f_r, they compute the reference position x_r = x_e + f_r / k. Erickson,
    Weber and Sharf [2]_ predict the force by b v + k x. They estimate the damping b, but not the
    position of the surface.

    This class contains only the estimator, without the impedance controller. By default, it is the
    estimator of [2]_. With the model `datum`, which is f = b v + k x + f0, it estimates b, k and
    f0. There are two differences from the published estimators. First, the adaptation gain is
    normalised by the size of the regressors (v, x), so that one value of `rate` is suitable for
    every displacement and every specimen. Second, the gradient law is solved exactly over a sample
    period. The exact solution is stable for every rate and every sample period.

    A single sample corrects the estimates only in the direction of the regressor vector (v, x). So
    the estimates cannot converge faster than this direction changes, and a rate above the angular
    frequency of the motion has no advantage.

    Parameters
    ----------
    rate
        Rate [1/s] at which the force error of a sample with large regressors decays.
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. The ratios of these
        values determine the relative adaptation gains of the parameters.
    floor
        A sample has little effect if the sum of (regressor / size)^2 over its regressors is much
        smaller than this value. If they are equal, the force error decays at half of `rate`.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.

    References
    ----------
    .. [1] H. Seraji, R. Colbaugh, "Force tracking in impedance control", International Journal of
       Robotics Research, 1997.
    .. [2] D. Erickson, M. Weber, I. Sharf, "Contact stiffness and damping estimation for robotic
       systems", International Journal of Robotics Research, 2003.
    """

    step = staticmethod(step)
    used_settings = ("forgetting", *SIZES)

    def __init__(
        self,
        rate: float,
        sizes: tuple[float, ...],
        floor: float = 0.02,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        check_positive(rate=rate, floor=floor)
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        guess_variance = [scale * scale for scale in per_size]
        super().__init__(
            IndirectParameters(correlation, rate, floor, per_size),
            LinearGainState(**linear_gain_state(guess_variance)),
            model,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            RATE / settings.memory,
            settings.sizes,
            model=settings.model,
            correlation=settings.correlation,
        )
