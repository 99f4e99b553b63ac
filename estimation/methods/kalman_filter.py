"""Kalman filter of parameters that walk at random (KF)."""

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
    learn,
    take_in,
    variance,
)
from estimation.model import KELVIN_VOIGT, Model
from estimation.step import Regressors, below


@dataclass(frozen=True, slots=True)
class KalmanParameters(FactoredParameters):
    """Parameters of `step`, variances in units of P0."""

    Q: tuple[float, ...]
    """Growth of the variance of each parameter [1/s], (m,)."""
    ceiling: tuple[float, ...]
    """Variance of each parameter at which it grows no further, (m,)."""


def process_noise(
    memory: float, sample_period: float, sizes: tuple[float, ...]
) -> tuple[float, ...]:
    """Process noise with which parameters are followed with a time constant `memory`.

    A scalar filter of f = s theta + noise, with P^2 s^2 = Q T in the steady state, moves on by
    the share s^2 P a sample: Q = T / (memory s)^2.

    Parameters
    ----------
    memory
        Time constant [s].
    sample_period
        Time T between samples [s].
    sizes
        Size s of each regressor, as root mean square.

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
    """P <- P + Q dt, by one parameter after the other, none beyond its ceiling."""
    Q, ceiling = parameters.Q, parameters.ceiling
    for i in below[len(state.D)]:
        growth = Q[i] * dt
        room = ceiling[i] - variance(state, i)
        if room > 0.0:
            add_variance(state, i, growth if growth < room else room)


def step(
    parameters: KalmanParameters, state: FactoredState, phi: Regressors, f: float, dt: float
) -> None:
    """P <- P + Q dt, L = P phi / (1 + phi' P phi), P <- P - L phi' P."""
    walk(parameters, state, dt)
    spread = take_in(parameters, state, phi, 1.0)
    learn(parameters, state, phi, f, dt, spread)


class RandomWalkKalman(FactoredEstimator):
    """Kalman filter of an environment whose parameters walk at random.

    After G. De Gersem, H. Van Brussel, F. Tendick, "Reliable and enhanced stiffness perception
    in soft-tissue telemanipulation", Int. J. Robotics Research 24(10), 2005, who follow the
    stiffness of tissue with a Kalman filter. Taken from it: a parameter is a random walk and
    the force its noisy measurement, in the textbook's filter. Not taken: what else their filter
    holds, and the display of stiffness to the operator. Damping and further parameters walk
    as stiffness does.

    Only the ratio of the process noise to that of the force matters to the gain, so `Q` is
    given as such a ratio. It is additive: large stiffness is followed as fast as small.

    Where a regressor is zero, as velocity is in a hold, the variance of its parameter grows,
    but not beyond `ceiling`. The standard deviations are those for parameters that do not move.

    Parameters
    ----------
    process_noise
        Diagonal of Q: growth of the variance of b [(N s/m)^2] and k [(N/m)^2] and what else the
        model has, per second and per N^2 of force variance; see the function of this name.
    initial_covariance
        Diagonal of P0 in the units of RecursiveLeastSquares.
    ceiling
        Variances at which growth ends, per N^2 of force variance; P0 unless given.
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
        """Nothing: the covariance does not wind up."""
        return None
