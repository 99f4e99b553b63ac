"""Estimate the environment at the slave, for model-mediated feedback.

The environment is that at the tip of the slave. The position of the tip is play(x, d) - c f, with
the position x at the encoder, the lost motion d and the compliance c of the transmission. Without
this correction, lost motion would be hysteresis that no model of the environment explains.

If d is not known, there is one estimator for each of a few half widths d, and the model is that of
the estimator whose force errors are smallest.

The estimator is recursive least squares with the stiffening model f = b v + k x + k3 x^3. Two
conditions must be true for an estimate to be accepted:

- Its misfit (the systematic part of the force error, see `estimation.misfit`) is small.
- The 95 % interval of the predicted force at the deepest recent position is narrow.

The deepest recent position is the largest displacement. It decreases with the time constant `REACH`
while the displacement is smaller. It is at most the position of the largest recent force.

At the start, the model is the stiff prior, a spring with the large stiffness `STIFF_PRIOR`. Each
accepted estimate becomes the new model. If the force differs from that of the model for `CHANGED`
seconds, or if the misfit becomes too large, the environment has changed: the estimator starts
again, without the samples of the environment before. Otherwise a stiff model could keep the motion
so small that the old samples are never forgotten. Until the next accepted estimate, the model is
then the stiff prior, or the model before if this is softer and the new environment is softer still.
"""

from __future__ import annotations

import math

from drivers import Measurement, new_tuple
from estimation.conditioning import MatchedFilter
from estimation.estimator import LEVEL_95, Estimate
from estimation.filters import Play
from estimation.methods.recursive_least_squares import RecursiveLeastSquares
from estimation.misfit import Misfit
from estimation.model import STIFFENING
from estimation.transmission import RIGID, TransmissionCalibration
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
HALF_WIDTHS = tuple(30e-6 * i for i in range(9))
"""Half widths of the play of which one is chosen if the lost motion is not known [m]."""
WRONG = 0.3
"""Force error of the model, divided by the largest recent force, above which the model is treated
as wrong."""
LEAST_ERROR = 0.5
"""Force error below which the model is not treated as wrong [N]."""
CHANGED = 0.1
"""Time for which the model must be wrong until the estimator starts again [s]."""
SELECTION = 2.0
"""Time constant with which past force errors lose weight in the choice of the lost motion [s]."""
BETTER = 0.7
"""Ratio of the mean square force errors below which another lost motion is chosen."""


class PlayHypothesis:
    """Estimator of the environment for one half width of the play [m].

    `transmission` has the lag of the force and the compliance. If the body is not `glued`, the tip
    can leave it. The first sample is that of a time `shift` [s] shorter than the others, so that
    the estimators of a bank do not all compute in the same tick.
    """

    def __init__(
        self,
        half_width: float,
        transmission: TransmissionCalibration,
        glued: bool = True,
        shift: float = 0.0,
    ) -> None:
        self.half_width = half_width
        self._glued, self._shift = glued, shift
        self._lag, self._compliance = transmission.force_lag, transmission.compliance
        self._play = Play(half_width)
        self._conditioner = MatchedFilter(force_lag=self._lag, model=STIFFENING)
        self._noise_gain = self._conditioner.correlation(PERIOD)
        self._estimator = RecursiveLeastSquares(
            math.exp(-PERIOD / MEMORY), VARIANCE, PERIOD, STIFFENING, self._noise_gain
        )
        self._misfit = Misfit({"model": self._estimator})
        self.reset()

    def reset(self) -> None:
        """Discard samples and estimate."""
        self._play.reset()
        self._conditioner.reset()
        self._position = self._impulse = self._force = 0.0
        self._span = self._shift
        self._reach = 0.0
        self.strongest = 0.0
        """Largest recent force [N]; it decreases like the deepest recent position."""
        self.tip = 0.0
        """Latest position of the tip [m]."""
        self.error = 0.0
        """Weighted mean square of the force errors [N^2]."""
        self.sample = 0.0, 0.0, 0.0
        """Displacement [m], velocity [m/s] and force [N] of the last sample."""
        self.restart()

    def restart(self) -> None:
        """Discard the estimate, but not the state of the transmission."""
        self._estimator.reset()
        self._misfit.reset()
        self.misfit = 0.0
        self.estimate: Estimate | None = None
        """Latest estimate; None before the first one."""

    def update(self, position: float, force: float, dt: float) -> bool:
        """Process position and force; return whether this completes a sample with contact."""
        played = self._play.update(position)
        self.tip = played - self._compliance * force
        self._position += played * dt
        self._impulse += force * dt
        self._span = span = self._span + dt
        if span < SHORTEST:
            return False
        # The stretch is that of the force before the lag of its channel.
        f = self._impulse / span
        unlagged = f + self._lag * (force - self._force) / span
        tip = self._position / span - self._compliance * unlagged
        if tip < 0.0 and not self._glued:
            tip = 0.0  # the tip is away from the body, whose surface is at 0
        self._position = self._impulse = self._span = 0.0
        self._force = force
        x, v, f, further = self._conditioner.update(tip, f, span)
        kept = 1.0 - span / REACH
        self._reach = max(abs(x), self._reach * kept)
        self.strongest = max(abs(f), self.strongest * kept)
        self.sample = x, v, f
        if abs(f) < LEAST_FORCE:
            return False
        if abs(v) > LEAST_SPEED:
            self.estimate = self._estimator.advance([v, x, *further], f, span)
            self.misfit = self._misfit.update(x, v, f, span, further, {"model": self.estimate})[0]
        b, k, k3 = self._estimator.state.theta
        square = (f - b * v - k * x - k3 * further[0]) ** 2
        self.error += (square - self.error) * span / SELECTION
        return True

    def model(self) -> Environment | None:
        """Return the estimate as a model of the environment; None if its interval is too wide.

        In the model, a negative parameter is replaced by 0. If k is negative, k3 is also changed,
        so that the elastic force at the deepest recent position stays the same. If k3 is negative,
        k is changed for the same reason.
        """
        if self.estimate is None:
            return None
        k, k3 = self.estimate.k, self.estimate.further[0]
        x = self.deepest(k, k3)
        secant = k + k3 * x * x
        if not self.half_interval(x) <= WIDEST * secant * x:
            return None
        if k3 < 0.0:
            k, k3 = secant, 0.0
        elif k < 0.0:
            k, k3 = 0.0, secant / (x * x)
        return Environment(k, k3, max(self.estimate.b, 0.0), self._glued)

    def deepest(self, k: float, k3: float) -> float:
        """Return the deepest recent position [m], at most that of the largest recent force.

        A body that has become stiffer is not indented as deeply as the one before.
        """
        low, high = 0.0, self._reach
        if (k + k3 * high * high) * high <= self.strongest:
            return high
        for _ in range(12):
            middle = 0.5 * (low + high)
            if (k + k3 * middle * middle) * middle > self.strongest:
                high = middle
            else:
                low = middle
        return high

    def half_interval(self, x: float) -> float:
        """Return half of the width [N] of the 95 % interval of the predicted force at x [m].

        Only the elastic force k x + k3 x^3 is predicted. `x` is the position of the tip.
        """
        state, cube = self._estimator.state, x * x * x
        of_k, of_k3 = state.C[1], state.C[2]
        variance = (of_k[1] * x + 2.0 * of_k[2] * cube) * x + of_k3[2] * cube * cube
        return LEVEL_95 * math.sqrt(max(self._noise_gain * state.noise * variance, 0.0))


class LocalModel:
    """Estimates the parameters of the environment (the specimen) from data of the slave.

    `transmission` has the lag of the contact force, and lost motion and compliance between encoder
    and tip. If its lost motion is not `known`, it is identified. If the specimen is glued, the
    model also pulls.
    """

    def __init__(
        self,
        transmission: TransmissionCalibration = RIGID,
        known: bool = True,
        glued: bool = True,
    ) -> None:
        self._known = known
        widths = (transmission.lost_motion,) if known else HALF_WIDTHS
        shift = PERIOD / len(widths)
        self._bank = [
            PlayHypothesis(width, transmission, glued, i * shift) for i, width in enumerate(widths)
        ]
        self._prior = Environment(STIFF_PRIOR, 0.0, 0.0, glued)
        self.reset()

    def reset(self) -> None:
        """Discard samples and estimate. The model becomes the stiff prior (a stiff spring)."""
        for hypothesis in self._bank:
            hypothesis.reset()
        self._chosen = self._bank[0]
        self._accepted = False
        self._wrong = 0.0
        self.model = self._prior
        """Model of the environment: the latest accepted estimate, or the stiff prior."""

    @property
    def half_width(self) -> float:
        """Half width of the play between encoder and tip, known or identified [m]."""
        return self._chosen.half_width

    @property
    def tip(self) -> float:
        """Latest position of the tip [m]."""
        return self._chosen.tip

    def update(self, pair: Pair) -> None:
        """Update the estimate with a slave position and a contact force of the same time."""
        complete = [one for one in self._bank if one.update(*pair)]
        if self._chosen not in complete:
            return
        if not self._known:
            self._choose()
        chosen = self._chosen
        if chosen.misfit > WORST_MISFIT or self._is_wrong(*chosen.sample):
            self._restart()
        elif model := chosen.model():
            self.model, self._accepted = model, True

    def _choose(self) -> None:
        """Choose the lost motion with the smallest force errors, if they are much smaller.

        A misfit that another lost motion explains is no change of the environment.
        """
        best = min(self._bank, key=lambda one: one.error)
        if best.error < BETTER * self._chosen.error:
            self._chosen = best
        elif self._chosen.misfit > WORST_MISFIT:
            self._chosen = min(self._bank, key=lambda one: one.misfit)

    def _is_wrong(self, x: float, v: float, f: float) -> bool:
        """Return whether the accepted model has been wrong for `CHANGED` seconds."""
        if not self._accepted or not self._known:
            return False
        error = abs(f - self.model.force(x, v))
        is_wrong = error > WRONG * self._chosen.strongest and error > LEAST_ERROR
        self._wrong = self._wrong + PERIOD if is_wrong else 0.0
        return self._wrong > CHANGED

    def _restart(self) -> None:
        """Discard the estimates, because the environment has changed."""
        x, _, f = self._chosen.sample
        softer = abs(f) < abs(self.model.force(x, 0.0))
        secant = self.model.k + self.model.k3 * x * x
        if not (softer and secant < STIFF_PRIOR):
            self.model = self._prior
        self._accepted, self._wrong = False, 0.0
        for hypothesis in self._bank:
            hypothesis.restart()


class ModelMediatedSlave(SlaveHalf):
    """Slave half of model-mediated feedback: estimates the environment and sends the estimate."""

    def __init__(
        self,
        coupling: Coupling,
        model: LocalModel,
        transmission: TransmissionCalibration = RIGID,
    ) -> None:
        super().__init__(coupling, transmission=transmission)
        self._local = model
        self._confirmed = False

    def align(self) -> None:
        """Discard the estimate. This is done each time the drives are armed."""
        super().align()
        self._local.reset()
        self._confirmed = False

    def observe(self, pair: Pair) -> None:
        """Update the estimate, and check the model with the measured contact force.

        The model is confirmed if the measured force is large enough, and is not much larger than
        the predicted force. `stiffness` uses the result of this check.
        """
        local = self._local
        local.update(pair)
        self._tip.half_width = local.half_width
        force = abs(pair.force)
        self._confirmed = force > CONFIRMED and force <= DOUBT * abs(
            local.model.force(local.tip, 0.0)
        )

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet for the master half: contact force and model of the environment."""
        force, tip = measurement.contact_force, self.tip(measurement)
        return new_tuple(Report, (force, self._local.model, 0.0, tip))

    def load(self, tip: float, measurement: Measurement) -> tuple[float, float]:
        """Return the contact force of the model [N] with the tip at a position, and its slope."""
        model = self._local.model
        return model.force(tip, 0.0), model.slope(tip)

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
