"""Kalman active observer: the parameters and a force disturbance beside them (AOB)."""

from __future__ import annotations

from estimation.methods.kalman_filter import RandomWalkKalman
from estimation.model import KELVIN_VOIGT, Model


class ActiveObserver(RandomWalkKalman):
    """Kalman filter of the parameters and of an active state p, f = phi' theta + p.

    After R. Cortesao, J. Park, O. Khatib, "Real-time adaptive control for haptic
    telemanipulation with Kalman active observers", IEEE Trans. Robotics 22(5), 2006, and
    R. Cortesao, "On Kalman active observers", J. Intelligent and Robotic Systems 48(2), 2007.
    Taken from them: the active state, one more state that takes up all that the model does
    not explain, with their stochastic equation of first order

        p(n) - p(n-1) = w,    var w = Qp dt var e,

    and a Kalman filter of the state so augmented. Not taken: the controller. Theirs observes a
    robot under force control, p acts at its input, and stiffness is adapted from force errors;
    here a listener has no input, p is a force at the surface [N], and the other states are
    the parameters, random walks as in `RandomWalkKalman`.

    p takes up a datum that is off, friction or slow relaxation, and tells of them. In a hold
    it cannot be told from k x. A slow p keeps the first guess for long, and the standard
    deviations of k and p are too large for several of its time constants.

    Parameters
    ----------
    process_noise, initial_covariance, ceiling
        As for `RandomWalkKalman`, those of p last: Qp [N^2/s], the first and the largest
        variance [N^2], all per N^2 of force variance.
    model
        The regressors, besides the constant one of p.
    correlation
        Samples for each independent one, see `LinearGainEstimator`.

    Raises
    ------
    ValueError
        A parameter is out of its range.
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
