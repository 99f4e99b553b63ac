"""Kalman filter (KF) of parameters that change as random walks."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from estimation.checks import positive_values
from estimation.estimator import Estimates
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
    """Constant settings of the function `step`. Variances are in units of P0."""

    Q: tuple[float, ...]
    """Increase of the variance of each parameter per second [1/s], (m,)."""
    ceiling: tuple[float, ...]
    """Largest variance of each parameter, (m,)."""


def process_noise(
    memory: float, sample_period: float, sizes: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the process noise Q with which a Kalman filter has the time constant `memory`.

    Consider the filter of one parameter theta with f = s theta + e, where the noise e has the
    variance 1. Let P be the variance of the estimate, with s^2 P << 1. A sample decreases P by
    s^2 P^2, and the process noise increases P by Q T between two samples. So s^2 P^2 = Q T in the
    steady state. A sample corrects the fraction s^2 P of the error of the estimate, so the time
    constant of the error is T / (s^2 P). This time constant is equal to `memory` if
    Q = T / (memory s)^2.

    Parameters
    ----------
    memory
        Time constant [s].
    sample_period
        Time T between samples [s].
    sizes
        Root mean square s of each regressor, in its SI unit.

    Returns
    -------
    Increase of the variance of each parameter per second, for force noise with a variance of 1 N^2.

    Raises
    ------
    ValueError
        A value is not positive.
    """
    if not all(0.0 < value < inf for value in (memory, sample_period, *sizes)):
        raise ValueError(
            f"memory, sample period and sizes must be positive, got {memory}, {sample_period}, "
            f"{sizes}"
        )
    return tuple(sample_period / (memory * size) ** 2 for size in sizes)


def walk(parameters: KalmanParameters, state: FactoredState, dt: float) -> None:
    """Set P <- P + Q dt, but do not increase a variance above its ceiling."""
    Q, ceiling = parameters.Q, parameters.ceiling
    for i in below[len(state.D)]:
        growth = Q[i] * dt
        room = ceiling[i] - variance(state, i)
        if room > 0.0:
            add_variance(state, i, growth if growth < room else room)


def step(
    parameters: KalmanParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """Set P <- P + Q dt, compute the gain L, set P <- P - L phi' P, and update theta with L.

    The gain is L = P phi / (1 + phi' P phi). P is for force noise with a variance of 1 N^2.
    """
    walk(parameters, state, dt)
    spread = update_covariance(parameters, state, phi, 1.0)
    correct_with_gain(parameters, state, phi, f, dt, spread)


class RandomWalkKalman(FactoredEstimator):
    """Kalman filter whose states are the parameters of an environment.

    Each parameter is modelled as a random walk, and the force is a noisy measurement of the
    parameters. The method is based on G. De Gersem, H. Van Brussel, F. Tendick, "Reliable and
    enhanced stiffness perception in soft-tissue telemanipulation", Int. J. Robotics Research
    24(10), 2005. They track the stiffness of tissue with a Kalman filter. The other states of their
    filter, and the display of stiffness to the operator, are omitted. In this class, damping and
    all other parameters of the model are also random walks.

    The gain depends only on the ratio of the process noise to the force noise, so `process_noise`
    is given as this ratio. The gain does not depend on the value of a parameter, so a large
    stiffness is tracked as fast as a small stiffness.

    While a regressor is zero, for example the velocity in a hold, the variance of its parameter
    increases up to `ceiling`. The standard deviations of the estimates are computed for constant
    parameters.

    Parameters
    ----------
    process_noise
        Diagonal of Q: the increase per second of the variances of b [(N s/m)^2 / s], k
        [(N/m)^2 / s] and any further parameters of the model, for force noise with a variance of
        1 N^2. The function `process_noise` computes these values.
    initial_covariance
        Diagonal of P0, in the units of `RecursiveLeastSquares`.
    ceiling
        Largest variance of each parameter, in the units of P0. Default: P0.
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

    def note(self, estimates: Estimates) -> str | None:
        """Return None: no warning is needed, because the covariance does not wind up."""
        return None
