"""Kalman active observer (AOB) of the parameters of an environment and of a disturbance force."""

from __future__ import annotations

from estimation.methods.kalman_filter import RandomWalkKalman
from estimation.model import KELVIN_VOIGT, Model


class ActiveObserver(RandomWalkKalman):
    """Kalman filter of the parameters theta and of an active state p, with f = phi' theta + p.

    The method is based on R. Cortesao, J. Park, O. Khatib, "Real-time adaptive control for haptic
    telemanipulation with Kalman active observers", IEEE Trans. Robotics 22(5), 2006, and
    R. Cortesao, "On Kalman active observers", J. Intelligent and Robotic Systems 48(2), 2007.
    The active state p is an additional state. It is the force at the surface [N] that phi' theta
    does not describe. Its model is a random walk,

        p(n) - p(n-1) = w,    var w = Qp dt var e,

    where e is the force noise. The other states are the parameters. They are also random walks, as
    in `RandomWalkKalman`. One Kalman filter estimates all states.

    In the two papers, the observer is part of the force control of a robot. There p acts at the
    input of the robot, and the stiffness is adapted from force errors. This class contains no
    controller, and the estimator has no control input.

    p contains the force due to friction, to slow relaxation, and to a wrong zero of x or f.
    While x is constant, p cannot be distinguished from k x. If Qp is small, the estimate of p
    changes slowly from its initial value 0. During the first time constants of this
    change, the standard deviations of k and p are too large.

    Parameters
    ----------
    process_noise, initial_covariance, ceiling
        As in `RandomWalkKalman`, with one more value for p at the end. The three values for p are
        Qp [N^2/s], the initial variance and the largest variance [N^2], for force noise with a
        variance of 1 N^2.
    model
        Model that defines the regressors phi. The state p and its regressor 1 are not part of the
        model.
    correlation
        Number of samples per independent value of the force noise, see `LinearGainEstimator`.

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
