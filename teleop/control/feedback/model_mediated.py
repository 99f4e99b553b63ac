"""Model-mediated feedback: the hand feels a local model of the environment, without delay.

The dynamics that the hand feels at the master are

    m v' + (d + b) v + k x + k3 x^3 = f_h

f_h is the force of the hand. x and v are the position and the velocity of the master. m is the
virtual mass and d its damping. k, k3 and b are the parameters of the model. The slave estimates
them (see `local_model`) and sends them through the communication channel. The displayed force
depends only on the model, and not on a delayed force. Therefore a delay cannot cause an
oscillation. If the parameters change by dk and dk3, the energy that is stored in the model
increases by

    dU = 1/2 dk x^2 + 1/4 dk3 x^4

If this energy is taken from an energy tank, the model remains passive while it changes. The energy
that the damping d dissipates fills the tank. A change to a stiffer model needs energy, but a change
to a softer model does not. For this reason, the model begins with a large stiffness, the stiff
prior.

At each tick, the parameters change by a fraction of the difference
between the estimated parameters and the parameters of the model. The fraction is limited for two
reasons: dU must not exceed the energy in the tank, and the displayed force must not change too
fast. The limits are easy to compute, because dU and the change of the force,
dk x + dk3 x^3 + db v, are proportional to the fraction.

Sources: P. Mitra, G. Niemeyer, "Model-mediated telemanipulation", Int. J. Robotics Research 27(2),
2008; X. Xu, B. Cizmeci, C. Schuwerk, E. Steinbach, "Model-mediated teleoperation: toward stable and
transparent teleoperation systems", IEEE Access 4, 2016.
"""

from __future__ import annotations

from drivers import new_tuple
from teleop.control.admittance import Admittance, Environment
from teleop.control.feedback.energy_tank import EnergyTank
from teleop.control.feedback.law import (
    STIFF_PRIOR,
    LawInputs,
    MasterHalf,
    MasterMotion,
    MasterState,
    Report,
    SlaveHalf,
)
from teleop.control.feedback.local_model import LocalModel, ModelMediatedSlave

FORCE_RATE = 50.0
"""Largest rate at which changes of the model may change the displayed force [N/s]."""


class ModelMediatedMaster(MasterHalf):
    """Master half of model-mediated feedback: the hand feels a model of the environment."""

    displays_prior = True

    @classmethod
    def halves(cls, given: LawInputs) -> tuple[MasterHalf, SlaveHalf]:
        """Create the two halves of the law. The slave half estimates the stiffness."""
        master = cls(given.admittance, given.coupling.scale, given.gain, given.glued)
        model = LocalModel(given.transmission, given.lost_motion_known, given.glued)
        return master, ModelMediatedSlave(given.coupling, model, given.transmission)

    def __init__(
        self, admittance: Admittance, scale: float = 1.0, gain: float = 1.0, glued: bool = True
    ) -> None:
        super().__init__(admittance, scale, gain)
        self._glued = glued
        self._damping = admittance.parameters.damping
        ratio = gain * scale
        self._ratios = ratio, ratio * scale * scale
        self.align()

    def align(self) -> None:
        """Reset the model and the energy tank. This is done each time the drives are armed.

        The model becomes the stiff prior (a stiff spring). The tank gets its initial energy.
        """
        self._tank = EnergyTank()
        self._reached: Environment | None = None
        self._before = self._dt = 0.0
        self._model = Environment(self.gain * self.scale * STIFF_PRIOR, 0.0, 0.0, self._glued)
        self.state = MasterState(0.0, self._model, self._tank.energy)

    def step(self, force: float, report: Report, dt: float) -> MasterMotion:
        """Change the model towards the estimate of the slave, and move the virtual mass.

        The force of the hand and the force of the model act on the virtual mass.
        """
        admittance = self.admittance
        start, before = admittance.position, admittance.velocity
        # If a velocity changes linearly, its mean square is at least the square of its mean. The
        # motion of the last tick is known only now, because a limit may have reduced the velocity.
        mean = 0.5 * (self._before + before)
        self._tank.fill(self._damping * mean * mean * self._dt)
        self._before, self._dt = before, dt
        if report.model is not self._reached:
            self._approach(report.model, start, dt)
        model = self._model
        self.started = model.force(start, before)
        velocity = admittance.step_against(force, model, dt)
        position = admittance.position
        self.reserve = tank = self._tank.energy
        displayed = model.force(position, velocity)
        self.state = new_tuple(MasterState, (displayed, model, tank))
        return new_tuple(MasterMotion, (position, velocity, 0.0))

    def _approach(self, estimate: Environment, x: float, dt: float) -> None:
        """Change the model that the hand feels towards the estimate of the slave.

        Two limits can reduce the change: the largest rate of change of the displayed force
        (`FORCE_RATE`), and the energy in the energy tank. `x` is the position of the virtual mass
        [m].
        """
        k, k3, b, glued = self._model
        ratio, cubic_ratio = self._ratios
        dk, dk3, db = ratio * estimate.k - k, cubic_ratio * estimate.k3 - k3, ratio * estimate.b - b
        share = 1.0
        if x > 0.0 or glued:
            square = x * x
            cost = (0.5 * dk + 0.25 * dk3 * square) * square
            step = abs((dk + dk3 * square) * x) + abs(db * self.admittance.velocity)
            most = FORCE_RATE * dt
            if step > most:
                share = most / step
            if cost > 0.0:
                share *= self._tank.affordable(cost * share)
                self._tank.pay(cost * share)
        if share == 1.0:
            self._reached = estimate
        k, k3, b = k + share * dk, k3 + share * dk3, b + share * db
        values = (0.0 if k < 0.0 else k, 0.0 if k3 < 0.0 else k3, 0.0 if b < 0.0 else b, glued)
        self._model = new_tuple(Environment, values)
