"""Estimate of the environment at the slave, for model-mediated feedback.

Recursive least squares with the stiffening model f = b v + k x + k3 x^3. An estimate is accepted
when the 95 % interval of the force that it predicts at the deepest recent position is narrow, and
its misfit is small. Without an accepted estimate, the model is the stiff prior.
"""

from __future__ import annotations

import math

from drivers import Measurement
from estimation.conditioning import MatchedFilter
from estimation.estimator import LEVEL_95, Estimate
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.misfit import Misfit
from estimation.model import STIFFENING
from teleop.control.admittance import Environment
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.control.feedback.law import STIFF_PRIOR, Report, Slave

WIDEST = 0.1
"""Widest accepted 95 % half interval of the predicted force, as a fraction of the force."""
WORST_MISFIT = 0.25
"""Greatest accepted misfit."""
LEAST_FORCE = 0.2
"""Force [N] above which a sample is used: the model of the free slave is not estimated."""
LEAST_SPEED = 3e-4
"""Speed [m/s] above which a sample is used."""
MEMORY = 1.0
"""Time constant of the forgetting [s]."""
REACH = 2.0
"""Time constant with which the deepest recent position is forgotten [s]."""
VARIANCE = (1e4, 1e9, 1e21)
"""Initial variances of b, k and k3."""
ROUNDING = 1e-6
"""Tolerance for rounding errors of times [s]."""
PERIOD = 5e-3
"""Time between two samples of the estimator [s]. The filtered signals of 20 Hz need no shorter one,
and an update at each tick would be a quarter of the cost of a tick."""

CONFIRMED = 1.0
"""Contact force [N] above which the force can confirm the model."""
DOUBT = 0.25
"""Relative excess of the force over that of the model above which the model is not confirmed."""


class LocalModel:
    """The estimated environment at the slave.

    Parameters
    ----------
    force_lag
        Lag of the force channel that is compensated [s].
    glued
        Whether the specimen is glued, so that it also pulls.
    """

    def __init__(self, force_lag: float = 0.0, glued: bool = True) -> None:
        self._conditioner = MatchedFilter(force_lag=force_lag, model=STIFFENING)
        self._estimator = RecursiveLeastSquares(
            math.exp(-PERIOD / MEMORY),
            VARIANCE,
            PERIOD,
            STIFFENING,
            self._conditioner.correlation(PERIOD),
        )
        self._noise_gain = self._conditioner.correlation(PERIOD)
        self._misfit = Misfit({"model": self._estimator})
        self._prior = Environment(STIFF_PRIOR, 0.0, 0.0, glued)
        self.reset()

    def reset(self) -> None:
        """Discard all samples."""
        self._estimator.reset()
        self._conditioner.reset()
        self._misfit.reset()
        self._reach = 0.0
        self._span = 0.0
        self.model = self._prior
        """The accepted estimate, or the prior."""

    def update(self, pair: Pair) -> None:
        """Process a pair of position and force."""
        x, v, f, further = self._conditioner.update(*pair)
        self._span += pair.dt
        if self._span < PERIOD - ROUNDING:
            return
        dt, self._span = self._span, 0.0
        self._reach = max(abs(x), self._reach * (1.0 - dt / REACH))
        if abs(f) < LEAST_FORCE or abs(v) < LEAST_SPEED:
            return
        estimate = self._estimator.advance([v, x, *further], f, dt)
        misfit = self._misfit.update(x, v, f, dt, further, {"model": estimate})[0]
        self.model = self._accepted(estimate, misfit)

    def _accepted(self, estimate: Estimate, misfit: float) -> Environment:
        """Return the estimate with b, k and k3 not negative, the last accepted one, or the prior.

        If k or k3 is negative, it is replaced by 0, and the other by the value with the same force
        at the deepest recent position.
        """
        x, k, k3 = self._reach, estimate.k, estimate.further[0]
        if misfit > WORST_MISFIT:
            return self._prior
        secant = k + k3 * x * x
        if not self._half_interval(x) <= WIDEST * secant * x:
            return self.model
        if k3 < 0.0:
            k, k3 = secant, 0.0
        elif k < 0.0:
            k, k3 = 0.0, secant / (x * x)
        return Environment(k, k3, max(estimate.b, 0.0), self._prior.glued)

    def _half_interval(self, x: float) -> float:
        """Return half the width of the 95 % interval of the predicted force [N] at x [m]."""
        state, cube = self._estimator.state, x * x * x
        of_k, of_k3 = state.C[1], state.C[2]
        variance = (of_k[1] * x + 2.0 * of_k[2] * cube) * x + of_k3[2] * cube * cube
        return LEVEL_95 * math.sqrt(max(self._noise_gain * state.noise * variance, 0.0))


class ModelMediatedSlave(Slave):
    """Slave half of model-mediated feedback: estimates the environment.

    Parameters
    ----------
    coupling
        Maps the motion of the master to that of the slave.
    model
        The estimate of the environment.
    """

    def __init__(self, coupling: Coupling, model: LocalModel) -> None:
        super().__init__(coupling)
        self._local = model
        self._confirmed = False

    def align(self) -> None:
        """Discard the estimate."""
        self._local.reset()
        self._confirmed = False

    def observe(self, pair: Pair) -> None:
        """Update the estimate, and compare the force with that of the model."""
        self._local.update(pair)
        predicted = self._local.model.force(pair.position, 0.0)
        excess = abs(pair.force) - max(abs(predicted) * (1.0 + DOUBT), CONFIRMED)
        self._confirmed = abs(pair.force) > CONFIRMED and excess <= 0.0

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return contact force and model."""
        return Report(measurement.contact_force, self._local.model)

    def stiffness(self, position: float) -> float:
        """Return the slope of the expected force [N/m] at a position of the slave [m].

        It is at least that of the stiff prior at the beginning of a contact, and while the force is
        larger than that of the model, because the specimen may be a stiffer one.
        """
        tangent = self._local.model.tangent(position)
        return tangent if self._confirmed else max(tangent, STIFF_PRIOR)
