"""Kalman filter (KF) for damping, stiffness and other parameters that change as random walks."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Self

from estimation.checks import positive_values
from estimation.estimator import Estimates
from estimation.method_settings import MethodSettings
from estimation.methods.ud_factors import (
    FactoredEstimator,
    FactoredParameters,
    FactoredState,
    add_variance,
    correct_with_gain,
    update_covariance,
    variance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below


@dataclass(frozen=True, slots=True)
class KalmanParameters(FactoredParameters):
    """Constant settings of the estimator `RandomWalkKalman`.

    In these settings, each variance is divided by the initial variance of the same parameter.
    """

    Q: tuple[float, ...]
    """Process noise: increase of the variance of each parameter per second [1/s], (m,)."""
    ceiling: tuple[float, ...]
    """Upper limit of the variance of each parameter, (m,)."""


def process_noise(
    memory: float, sample_period: float, sizes: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the process noise Q for which the Kalman filter has the time constant `memory`.

    The time constant describes how fast the estimate follows a change of a parameter. Consider the
    filter of one parameter theta with f = s theta + e. s is the regressor, and the noise e has the
    variance 1 N^2. Let P be the variance of the estimate, with s^2 P << 1. A sample decreases P by
    s^2 P^2. The process noise increases P by Q T between two samples. So s^2 P^2 = Q T in the
    steady state. A sample corrects the fraction s^2 P of the error of the estimate, so the time
    constant of the error is T / (s^2 P). This time constant is equal to `memory` if
    Q = T / (memory s)^2.

    The result is Q of each parameter per second, for force noise with a variance of 1 N^2.
    """
    if not all(0.0 < value < inf for value in (memory, sample_period, *sizes)):
        raise ValueError(
            f"memory, sample period and sizes must be positive, got {memory}, {sample_period}, "
            f"{sizes}"
        )
    return tuple(sample_period / (memory * size) ** 2 for size in sizes)


def largest_variances(settings: MethodSettings) -> tuple[float, ...]:
    """Return the default `ceiling` of each parameter, for force noise with a variance of 1 N^2."""
    return tuple(1.0 / size**2 for size in settings.sizes)


def walk(parameters: KalmanParameters, state: FactoredState, dt: float) -> None:
    """Add the process noise to the covariance of the parameters: P <- P + Q dt.

    The diagonal matrix Q contains the increase of each variance per second. A variance is increased
    at most to its upper limit, the setting `ceiling`. A variance above this limit is not changed.
    """
    Q, ceiling = parameters.Q, parameters.ceiling
    for i in below[len(state.D)]:
        growth = Q[i] * dt
        room = ceiling[i] - variance(state, i)
        if room > 0.0:
            add_variance(state, i, growth if growth < room else room)


def step(
    parameters: KalmanParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Process one sample with the equations of the Kalman filter.

    First, the process noise is added to the covariance P (function `walk`). Then P and the
    parameters theta are updated with the regressors phi and the force f:

        P <- P + Q dt,
        L = P phi / (1 + phi' P phi),    theta <- theta + L (f - phi' theta),    P <- P - L phi' P.

    The number 1 in the gain L is the variance of the force noise [N^2] for which P is computed.
    """
    walk(parameters, state, dt)
    spread = update_covariance(parameters, state, phi, 1.0)
    correct_with_gain(parameters, state, phi, f, dt, spread)


class RandomWalkKalman(FactoredEstimator):
    """Kalman filter whose states are the parameters of the environment, for example b and k.

    Each parameter is modelled as a random walk. The measured force is f = phi' theta plus noise,
    with the regressors phi and the parameters theta; for example, phi = (v, x) and theta = (b, k).

    The method is based on G. De Gersem, H. Van Brussel, F. Tendick, "Reliable and enhanced
    stiffness perception in soft-tissue telemanipulation", Int. J. Robotics Research 24(10), 2005.
    In that paper, a Kalman filter tracks the stiffness of tissue. The other states of that filter,
    and the display of stiffness to the operator, are omitted here. In this class, damping and all
    other parameters of the model are also random walks.

    The gain depends only on the ratio of the process noise to the variance of the force noise. So
    `process_noise` is given for force noise with a variance of 1 N^2. The gain does not depend on
    the value of a parameter, so a large stiffness is tracked as fast as a small stiffness.

    While a regressor is zero, the samples contain no information about its parameter. An example is
    the velocity while the slave does not move. The variance of the parameter then increases up to
    `ceiling`.

    The standard deviations of the estimates contain only the effect of the force noise. They do not
    contain the error that occurs while the true parameters change.

    Parameters
    ----------
    process_noise
        Diagonal of Q: the increase per second of the variances of b [(N s/m)^2 / s], k
        [(N/m)^2 / s] and any further parameters of the model, for force noise with a variance of
        1 N^2. The function `process_noise` computes these values.
    initial_covariance
        As in `RecursiveLeastSquares`.
    ceiling
        Largest variance of each parameter, in the units of `initial_covariance`. Default: the
        initial covariance.
    model, correlation
        Model f = phi' theta, and correlation length of the force noise (`LinearGainEstimator`).

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    step = staticmethod(step)
    parameter_type = KalmanParameters

    def __init__(
        self,
        process_noise: tuple[float, ...],
        initial_covariance: tuple[float, ...],
        ceiling: tuple[float, ...] | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        q = positive_values("process noise", process_noise, model)
        p0 = positive_values("initial covariance", initial_covariance, model)
        most = positive_values("ceiling", p0 if ceiling is None else ceiling, model)
        growth = tuple(value / first for value, first in zip(q, p0, strict=True))
        room = tuple(value / first for value, first in zip(most, p0, strict=True))
        super().__init__(1.0, p0, None, model, correlation, Q=growth, ceiling=room)

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        return cls(
            process_noise(settings.memory, settings.sample_period, settings.sizes),
            settings.covariance,
            largest_variances(settings),
            settings.model,
            settings.correlation,
        )

    def note(self, estimates: Estimates) -> str | None:
        """Return None: this estimator gives no warning about its `estimates`.

        Other estimators warn if the covariance is too large. Here, `ceiling` limits the covariance.
        """
        return None
