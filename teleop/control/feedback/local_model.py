"""Estimate the environment at the slave, for model-mediated feedback.

The estimator is recursive least squares with the stiffening model f = b v + k x + k3 x^3. Two
conditions must be true for an estimate to be accepted:

- Its misfit (the systematic part of the force error, see `estimation.misfit`) is small.
- The 95 % interval of the predicted force at the deepest recent position is narrow.

The deepest recent position is the largest displacement. It decreases with the time constant `REACH`
while the displacement is smaller.

At the start, the model is the stiff prior, a spring with the large stiffness `STIFF_PRIOR`. Each
accepted estimate becomes the new model. If the misfit becomes too large, the stiff prior is used
again.
"""

from __future__ import annotations

import math

from drivers import Measurement, new_tuple
from estimation.conditioning import MatchedFilter
from estimation.estimator import LEVEL_95, Estimate
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.misfit import Misfit
from estimation.model import STIFFENING
from teleop.control.admittance import Environment
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.control.feedback.law import STIFF_PRIOR, Report, SlaveHalf

WIDEST = 0.1
"""Largest half width of the 95 % interval of the predicted force for which an estimate is accepted,
as a fraction of the predicted force."""
WORST_MISFIT = 0.25
"""Largest misfit for which an estimate is accepted."""
LEAST_FORCE = 0.2
"""Force [N] above which a sample is used. Therefore samples without contact are not used."""
LEAST_SPEED = 3e-4
"""Speed [m/s] above which a sample is used."""
MEMORY = 1.0
"""Time constant of the forgetting factor of the estimator [s]."""
REACH = 2.0
"""Time constant with which the deepest recent position decreases [s]."""
VARIANCE = (1e4, 1e9, 1e24)
"""Initial variances of b [N^2 s^2/m^2], k [N^2/m^2] and k3 [N^2/m^6] for a force noise with a
variance of 1 N^2. The estimator multiplies them by the variance of the force noise [N^2] and by
`estimation.linear_gain.DIFFUSE`. With a typical noise of 2 mN, the initial standard deviation of k3
is larger than the k3 of the hard cube (the stiffest of the specimens). This is necessary, because
the motion can be too small to determine k3. With a smaller initial variance, the estimate of k3
would then stay near 0 with an interval that is too narrow. A model without stiffening would be
accepted."""
PERIOD = 10e-3
"""Time over which position and force are averaged to one sample of filter and estimator [s]. Both
are averaged in the same way, so that the averages cause no bias. A shorter time is not needed,
because the filter removes frequencies above `estimation.conditioning.BANDWIDTH`. An update at each
tick would take a quarter of the computing time of a tick."""
SHORTEST = PERIOD - 1e-6
"""Shortest time that is averaged to one sample, with a tolerance for rounding errors [s]."""
CONFIRMED = 1.0
"""Contact force [N] above which a measured force can show that the model is correct."""
DOUBT = 1.25
"""Largest ratio of measured force to predicted force at which the model is treated as correct."""


class LocalModel:
    """Estimates the parameters of the environment (the specimen) from data of the slave.

    The lag of the contact force sensor [s] is compensated. If the specimen is glued, the model also
    pulls.
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
        """Discard samples and estimate. The model becomes the stiff prior (a stiff spring)."""
        self._estimator.reset()
        self._conditioner.reset()
        self._misfit.reset()
        self._reach = 0.0
        self._position = self._force = self._span = 0.0
        self.model = self._prior
        """The latest accepted estimate. At the start and after a large misfit, it is the stiff
        prior."""

    def update(self, pair: Pair) -> None:
        """Update the estimate with a slave position and a contact force of the same time."""
        position, force, dt = pair
        self._position += position * dt
        self._force += force * dt
        self._span = span = self._span + dt
        if span < SHORTEST:
            return
        x, v, f, further = self._conditioner.update(self._position / span, self._force / span, span)
        self._position = self._force = self._span = 0.0
        self._reach = max(abs(x), self._reach * (1.0 - span / REACH))
        if abs(f) < LEAST_FORCE or abs(v) < LEAST_SPEED:
            return
        estimate = self._estimator.advance([v, x, *further], f, span)
        misfit = self._misfit.update(x, v, f, span, further, {"model": estimate})[0]
        self.model = self._accepted(estimate, misfit)

    def _accepted(self, estimate: Estimate, misfit: float) -> Environment:
        """Return the new model of the environment, which is the estimate if it is accepted.

        The estimate is not accepted in two cases. If the misfit is too large, the stiff prior (a
        stiff spring) is returned. If the 95 % interval of the predicted force is too wide, the
        previous model is returned.

        In an accepted estimate, a negative parameter is replaced by 0. If k is negative, k3 is also
        changed, so that the elastic force at the deepest recent position stays the same. If k3 is
        negative, k is changed for the same reason.
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
        """Return half of the width [N] of the 95 % interval of the predicted force at x [m].

        Only the elastic force k x + k3 x^3 is predicted. `x` is the position of the slave.
        """
        state, cube = self._estimator.state, x * x * x
        of_k, of_k3 = state.C[1], state.C[2]
        variance = (of_k[1] * x + 2.0 * of_k[2] * cube) * x + of_k3[2] * cube * cube
        return LEVEL_95 * math.sqrt(max(self._noise_gain * state.noise * variance, 0.0))


class ModelMediatedSlave(SlaveHalf):
    """Slave half of model-mediated feedback: estimates the environment and sends the estimate."""

    def __init__(self, coupling: Coupling, model: LocalModel) -> None:
        super().__init__(coupling)
        self._local = model
        self._confirmed = False

    def align(self) -> None:
        """Discard the estimate. This is done each time the drives are armed."""
        self._local.reset()
        self._confirmed = False

    def observe(self, pair: Pair) -> None:
        """Update the estimate, and check the model with the measured contact force.

        The model is confirmed if the measured force is large enough, and is not much larger than
        the predicted force. `stiffness` uses the result of this check.
        """
        local = self._local
        local.update(pair)
        force = abs(pair.force)
        self._confirmed = force > CONFIRMED and force <= DOUBT * abs(
            local.model.force(pair.position, 0.0)
        )

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet for the master half: contact force and model of the environment."""
        return new_tuple(Report, (measurement.contact_force, self._local.model, 0.0))

    def stiffness(self, position: float) -> float:
        """Return the expected slope of the contact force over the position of the slave [N/m].

        The slope is that of the model, k + 3 k3 x^2. It is at least `STIFF_PRIOR` (a large
        stiffness) while the measured contact force is below `CONFIRMED`, for example at the
        beginning of a contact, or is more than `DOUBT` times the predicted force. In both cases,
        the specimen may be stiffer than the model.
        """
        k, k3, _, _ = self._local.model
        tangent = k + 3.0 * k3 * position * position
        return STIFF_PRIOR if tangent < STIFF_PRIOR and not self._confirmed else tangent
