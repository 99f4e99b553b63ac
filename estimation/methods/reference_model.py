"""Model-reference adaptive estimator (MRAE)."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan, sqrt

from estimation.checks import positive_values
from estimation.estimator import Estimator
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, State, below, zeros


@dataclass(frozen=True, slots=True)
class ReferenceParameters:
    """Constant settings of the function `step`."""

    rate: float
    """Rate at which the force error decays [1/s]."""
    bandwidth: float
    """Bandwidth a of the reference and of the model [1/s]."""
    floor: float
    """The rate is halved at this value of s' s, with s_i = phi_i / size_i."""
    per_size: tuple[float, ...]
    """1 / typical size of each regressor, (m,)."""


@dataclass(slots=True)
class ReferenceState(State):
    """Variables that the function `step` updates."""

    e: float
    """Output error e [N]: the output of the reference minus the output of the model."""


def step(
    parameters: ReferenceParameters,
    state: ReferenceState,
    phi: Regressors,
    f: float,
    dt: float,
) -> None:
    """Integrate e and theta over one sample period by the implicit Euler method.

    e is the output error, and a is the bandwidth, see `ReferenceModel`. With s_i = phi_i / size_i,
    G = diag(1 / size_i^2) and n^2 = floor + s' s, the equations are

        de/dt = -a e + a (f - phi' theta) / n,    d theta / dt = rate G phi e / n.
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
    """Model-reference adaptive estimator. theta is adapted by the output error of a model.

    The method is based on S. K. Singh and D. O. Popa, "An analysis of some fundamental problems
    in adaptive control of force and impedance behavior: theory and experiments", IEEE
    Transactions on Robotics and Automation, 1995. In their paper, the parameters are adapted by the
    tracking error between a force loop and a reference model. An estimator alone has no force loop.
    This class has the structure of the estimator in their paper, but other regressors.

    The reference is a first-order lag with the bandwidth a and the input f / n. The model is the
    same lag with the input phi' theta / n. The error e is the output of the reference minus the
    output of the model. theta is adapted by e:

        de/dt = -a e + a (f - phi' theta) / n,    d theta / dt = rate G phi e / n,

    where G = diag(1 / size_i^2), and n^2 = floor + s' s with s_i = phi_i / size_i. n increases with
    the magnitude of phi. So one rate is suitable for every depth and every specimen.

    Let the true parameters theta_0 be constant. Then the Lyapunov function V never increases:

        V = e^2 + a (theta - theta_0)' G^-1 (theta - theta_0) / rate,    dV/dt = -2 a e^2.

    The implicit Euler method has the same property for every rate and every `dt`.

    There are no standard deviations, because the lag makes the noise correlated.

    Parameters
    ----------
    rate
        Rate [1/s] at which the force error decays. This is valid if the rate is much less than
        the bandwidth.
    sizes
        Typical root mean square of each regressor, [m/s] for v, [m] for x. The ratios of these
        values determine the relative adaptation gains of the parameters.
    bandwidth
        Bandwidth a [1/s] of the reference and of the model. If the bandwidth is below four times
        the rate, e oscillates.
    floor
        The rate is halved at this value of s' s. Samples with a smaller s' s have little effect.
    model
        Model that defines the regressors.

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
        bandwidth: float = 200.0,
        floor: float = 0.02,
        model: Model = KELVIN_VOIGT,
    ) -> None:
        for name, value in (("rate", rate), ("bandwidth", bandwidth), ("floor", floor)):
            if not 0.0 < value < inf:
                raise ValueError(f"{name} must be positive, got {value}")
        per_size = tuple(1.0 / size for size in positive_values("sizes", sizes, model))
        m = model.regressors
        super().__init__(
            ReferenceParameters(rate, bandwidth, floor, per_size),
            ReferenceState(zeros(m), [nan] * m, False, 0.0),
            model,
        )
