"""Model-reference adaptive estimator (MRAE): adapt the parameters by a filtered force error."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan, sqrt
from typing import Self

from estimation.checks import check_positive, positive_values
from estimation.estimator import Estimator
from estimation.method_settings import SIZES, MethodSettings
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, State, below, zeros

RATE = 1.25
"""Rate of `reference`, in units of 1 / memory.

The settling time (see `benchmarks/tuning.py`) is 0.65 s. It is longer for all tested multiples of
this value.
"""
BANDWIDTH = 10.0
"""Bandwidth of the reference model of `reference`, in units of 1 / memory.

The bandwidth is eight times the rate. If the bandwidth were below four times the rate, the error of
the model would oscillate.
"""


@dataclass(frozen=True, slots=True)
class ReferenceParameters:
    """Constant settings of the estimator `ReferenceModel`."""

    rate: float
    """Rate at which the force error decays [1/s]."""
    bandwidth: float
    """Bandwidth a of the low-pass filter of the force error [1/s]."""
    floor: float
    """The rate is halved at this value of s' s, with s_i = phi_i / size_i."""
    per_size: tuple[float, ...]
    """1 / size_i, with the typical root mean square size_i of each regressor, (m,)."""


@dataclass(slots=True)
class ReferenceState(State):
    """Variables of the estimator `ReferenceModel` that change at each sample."""

    e: float
    """Output error e [N]: the low-pass filtered and normalised force error."""


def step(
    parameters: ReferenceParameters,
    state: ReferenceState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Process one sample: integrate two differential equations over the time `dt`.

    The equations are those of the output error e and of the parameters theta:

        de/dt = -a e + a (f - phi' theta) / n,    d theta / dt = rate G phi e / n.

    So e is the low-pass filtered force error with the bandwidth a, divided by n. The number n
    normalises the regressors phi: n^2 = floor + s' s with s_i = phi_i / size_i. G is the diagonal
    matrix with the elements 1 / size_i^2. The equations are integrated by the implicit Euler
    method.
    """
    theta, per_size = state.theta, parameters.per_size
    square = 0.0
    error = f
    for i in below[len(phi)]:
        s = phi[i] * per_size[i]
        square += s * s
        error -= phi[i] * theta[i]
    n = sqrt(parameters.floor + square)
    a = parameters.bandwidth * dt
    rate = parameters.rate * dt
    state.e = (state.e + a * (error / n)) / (1.0 + a + a * rate * (square / (n * n)))
    move = rate * (state.e / n)
    for i in below[len(phi)]:
        theta[i] += move * (phi[i] * per_size[i]) * per_size[i]


class ReferenceModel(Estimator):
    """Model-reference adaptive estimator: adapt the parameters theta by a filtered force error.

    The method is based on S. K. Singh and D. O. Popa, "An analysis of some fundamental problems
    in adaptive control of force and impedance behavior: theory and experiments", IEEE
    Transactions on Robotics and Automation, 1995. In their paper, the parameters are adapted by the
    tracking error between a force control loop and a reference model. An estimator alone has no
    force control loop. This class has the structure of the estimator in their paper, but other
    regressors.

    Two first-order low-pass filters have the same bandwidth a. The input of the first filter, the
    reference, is f / n with the measured force f. The input of the second filter is phi' theta / n
    with the regressors phi. The output error e is the output of the first filter minus that of the
    second filter. e follows the first of these equations, and theta is adapted by the second:

        de/dt = -a e + a (f - phi' theta) / n,    d theta / dt = rate G phi e / n,

    where G = diag(1 / size_i^2), and n^2 = floor + s' s with s_i = phi_i / size_i. size_i is the
    typical root mean square of phi_i, see `sizes`. n increases with the magnitude of phi. So one
    rate is suitable for every depth and every specimen.

    Let the true parameters theta_0 be constant, and let f be phi' theta_0. Then the Lyapunov
    function V never increases:

        V = e^2 + a (theta - theta_0)' G^-1 (theta - theta_0) / rate,    dV/dt = -2 a e^2.

    The equations are integrated by the implicit Euler method. V then never increases, for every
    rate and every `dt`.

    Standard deviations are not computed (NaN), because the low-pass filter makes the noise of e
    correlated.

    Parameters
    ----------
    rate
        Rate [1/s] at which the force error decays. This is valid if the rate is much less than
        the bandwidth.
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. The ratios of these
        values determine the relative adaptation gains of the parameters.
    bandwidth
        Bandwidth a [1/s] of the two low-pass filters. If the bandwidth is below four times the
        rate, e oscillates.
    floor
        Value of s' s at which the adaptation is half as fast as `rate`. Samples with a much
        smaller s' s have little effect.
    model
        Model of the environment. It defines the regressors phi and the parameters theta.

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
        bandwidth: float = 200.0,
        floor: float = 0.02,
        model: Model = KELVIN_VOIGT,
    ) -> None:
        check_positive(rate=rate, bandwidth=bandwidth, floor=floor)
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        m = model.regressors
        super().__init__(
            ReferenceParameters(rate, bandwidth, floor, per_size),
            ReferenceState(zeros(m), [nan] * m, False, 0.0),
            model,
        )

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        memory = settings.memory
        return cls(RATE / memory, settings.sizes, BANDWIDTH / memory, model=settings.model)
