"""Kalman active observer (AOB). It estimates the model parameters and a disturbance force."""

from __future__ import annotations

from typing import Self

from estimation.method_settings import MethodSettings
from estimation.methods.kalman_filter import RandomWalkKalman, largest_variances, process_noise
from estimation.model import KELVIN_VOIGT, Model

DISTURBANCE_MEMORY = 0.1
"""Time constant of the disturbance force p that `observer` estimates, in units of the memory.

p changes faster than b and k. The settling time (see `benchmarks/tuning.py`) is not defined: after
the specimen was replaced, p contains the change of the force, and the error of k remains above 5 %
for every time constant. The standard deviation of k due to noise depends only little on the time
constant. So this value is not an optimum.
"""


class ActiveObserver(RandomWalkKalman):
    """Kalman filter of the parameters theta and of a disturbance force p, with f = phi' theta + p.

    f is the measured force, and phi contains the regressors of the model, for example v and x. The
    disturbance force p [N] is the part of the force that phi' theta does not describe: friction,
    slow relaxation, and the effect of an offset of x or f. Its model is a random walk over the
    samples n,

        p(n) - p(n-1) = w,    var w = Qp dt var e,

    where e is the force noise and Qp is a setting. The parameters are also random walks, as in
    `RandomWalkKalman`. One Kalman filter estimates the parameters and p.

    The method is based on R. Cortesao, J. Park, O. Khatib, "Real-time adaptive control for haptic
    telemanipulation with Kalman active observers", IEEE Trans. Robotics 22(5), 2006, and
    R. Cortesao, "On Kalman active observers", J. Intelligent and Robotic Systems 48(2), 2007. The
    two papers call p the active state. There the observer is part of the force controller of a
    robot, p acts at the input of the robot, and the stiffness is adapted from force errors. This
    class contains no controller, and the filter has no control input.

    While x is constant, p cannot be distinguished from k x. If Qp is small, the estimate of p
    converges slowly from its initial value 0. At the beginning of this convergence, the standard
    deviations of k and p are too large.

    Parameters
    ----------
    process_noise, initial_covariance, ceiling
        As in `RandomWalkKalman`, with one value for each parameter of the model. Each argument has
        one more value for p at the end: Qp [N^2/s] in `process_noise`, the initial variance of p
        [N^2] in `initial_covariance`, and the largest variance of p [N^2] in `ceiling`. All values
        are for force noise with a variance of 1 N^2.
    model
        Model f = phi' theta that defines the regressors phi. The regressor of p, which is always 1,
        is not part of the model.
    correlation
        Correlation length of the force noise, in samples, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        An argument is out of its range.
    """

    constant = True

    def __init__(
        self,
        process_noise: tuple[float, ...],
        initial_covariance: tuple[float, ...],
        ceiling: tuple[float, ...] | None = None,
        model: Model = KELVIN_VOIGT,
        correlation: float = 1.0,
    ) -> None:
        augmented = Model(model.name, (*model.further, "f0"))
        super().__init__(process_noise, initial_covariance, ceiling, augmented, correlation)
        self.model = model
        self.names = (*model.parameters, "p")

    @classmethod
    def from_settings(cls, settings: MethodSettings) -> Self:
        """Construct the estimator with the settings of a preset."""
        period = settings.sample_period
        return cls(
            (
                *process_noise(settings.memory, period, settings.sizes),
                *process_noise(DISTURBANCE_MEMORY * settings.memory, period, (1.0,)),
            ),
            (*settings.covariance, 1e4),
            (*largest_variances(settings), 1.0),
            settings.model,
            settings.correlation,
        )
