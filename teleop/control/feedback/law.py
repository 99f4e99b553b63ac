"""Base classes of the two halves of a force-feedback law, and the packets that they exchange.

A force-feedback law computes the displayed force, which is the force that the hand feels from the
environment. The law consists of a master half and a slave half, which share no variable. At each
tick:

- The slave half computes a `Report` from the measurements and sends it to the master half.
- The master half computes the motion of the virtual mass from the force of the hand and the newest
  `Report`. It sends this motion to the slave half as a `MasterMotion`.
- The slave half computes the desired velocity of the slave from the newest `MasterMotion`.

The classes `MasterHalf` and `SlaveHalf` are also the law `none`, for which the displayed force is
zero. The hand then feels only the virtual mass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Measurement, new_tuple
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.control.admittance import Admittance, Environment
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.control.tip_position import TipPosition

STIFF_PRIOR = 20e3
"""Stiffness that is assumed for an unknown environment [N/m]. Soft tissue is less stiff."""

PASSIVE = 6e-3
"""Energy [J] that the displayed environment of a passive law may generate before the drives are
stopped.

It is the initial energy of the energy tank (`energy_tank.TANK_START`) plus a tolerance of 1 mJ."""


PRIOR = Environment(STIFF_PRIOR)
"""Model of an unknown environment."""
NO_BODY = Environment(math.nan, math.nan, math.nan)
"""Model that is recorded if the law uses no model of the environment; its values are NaN."""


class Report(NamedTuple):
    """Packet that the slave half of a force-feedback law sends to the master half."""

    force: float = 0.0
    """Contact force [N]."""
    model: Environment = PRIOR
    """Model of the environment. Its force is a function of the displacement of the slave."""
    energy: float = 0.0
    """Energy that the environment has given to the channel since the drives were armed [J]."""
    tip: float = 0.0
    """Position of the tip of the slave at rest [m], from which the master begins."""


class MasterMotion(NamedTuple):
    """Packet that the master half of a force-feedback law sends to the slave half."""

    position: float
    """Position of the virtual mass [m]."""
    velocity: float = 0.0
    """Velocity of the virtual mass [m/s]."""
    energy: float = 0.0
    """Energy that the hand has given to the channel since the drives were armed [J]."""


class LawInputs(NamedTuple):
    """Parts and settings of a trial from which the two halves of a law are created."""

    admittance: Admittance
    """Virtual mass, whose velocity is the desired velocity of the master."""
    coupling: Coupling
    gain: float
    """Ratio of the displayed force to the contact force."""
    transmission: TransmissionCalibration
    """Lag of the contact force, and lost motion and compliance between encoder and tip."""
    lost_motion_known: bool
    """Whether the lost motion is calibrated or stated. If not, a law with a local model identifies
    it."""
    glued: bool
    """Whether the specimen is glued to the slave, so that it also pulls."""
    stiffness: float
    """Expected slope of the contact force over the position of the slave [N/m]."""


class MasterState(NamedTuple):
    """Quantities of the master half of a force-feedback law that are recorded after each tick."""

    displayed: float = 0.0
    """Force that the hand feels from the environment [N]; positive if it opposes compression."""
    model: Environment = NO_BODY
    """Model of the environment that the hand feels. Its force is a function of the displacement of
    the master. The values are NaN if the law uses no model."""
    tank: float = math.nan
    """Energy in the energy tank [J]; NaN if the law has no energy tank."""


class MasterHalf:
    """Base class of the part of a force-feedback law that runs at the master.

    It is also the master half of the law `none`, for which the displayed force is zero. `scale` is
    the ratio of the motion of the slave to that of the master, and `gain` the ratio alpha of the
    displayed force to the contact force.
    """

    allowance = PASSIVE
    """Energy [J] that the displayed environment may generate before the drives are stopped."""
    displays_measured_force = False
    """Whether the hand feels the measured force, so that a delay can make the loop unstable."""
    displays_prior = False
    """Whether the hand feels the stiff prior until an estimate of the environment is accepted."""

    @classmethod
    def halves(cls, given: LawInputs) -> tuple[MasterHalf, SlaveHalf]:
        """Create the two halves of the law, for the master and for the slave."""
        master = cls(given.admittance, given.coupling.scale, given.gain)
        return master, SlaveHalf(given.coupling, given.stiffness, given.transmission)

    def __init__(self, admittance: Admittance, scale: float = 1.0, gain: float = 1.0) -> None:
        self.admittance = admittance
        self.scale = scale
        self.gain = gain
        self.state = MasterState()
        self.started = 0.0
        """Displayed force at the start of the last tick [N]."""
        self.reserve = 0.0
        """Stored energy that the law may give to the hand, such as the energy in the tank [J]."""

    def align(self) -> None:
        """Reset the law to its initial state. This is done each time the drives are armed."""
        self.state = MasterState()

    def step(self, force: float, report: Report, dt: float) -> MasterMotion:
        """Move the virtual mass under the force of the hand minus the displayed force.

        `dt` is the time since the previous tick, for which the force acts.
        """
        displayed = self.started = self.display(report, dt)
        self.admittance.step(force - displayed, dt)
        self.state = new_tuple(MasterState, (displayed, NO_BODY, math.nan))
        return new_tuple(MasterMotion, (self.admittance.position, self.admittance.velocity, 0.0))

    def display(self, report: Report, dt: float) -> float:
        """Return the displayed force [N]: the force that the hand feels from the environment.

        It is subtracted from the force of the hand on the virtual mass. In this class, it is zero.
        """
        return 0.0


class SlaveHalf:
    """Base class of the part of a force-feedback law that runs at the slave.

    It is also the slave half of the law `none`. Its tip follows the scaled position of the master:
    lost motion and compliance of the transmission are compensated. `stiffness` is the expected
    slope of the contact force over the position of the slave [N/m]. The supervisor uses it to limit
    the speed of the slave.
    """

    def __init__(
        self,
        coupling: Coupling,
        stiffness: float = STIFF_PRIOR,
        transmission: TransmissionCalibration = RIGID,
    ) -> None:
        self._scale, self._position_gain = coupling.scale, coupling.position_gain
        self._stiffness = stiffness
        self._compliance = transmission.compliance
        self._tip = TipPosition(transmission.lost_motion)

    def align(self) -> None:
        """Reset the law to its initial state. This is done each time the drives are armed."""
        self._tip.reset()

    def tip(self, measurement: Measurement) -> float:
        """Return the position of the tip of the slave at rest [m]."""
        return measurement.slave_position - self._compliance * measurement.contact_force

    def observe(self, pair: Pair) -> None:
        """Process a slave position and a contact force that were measured at the same time.

        A law can use them to estimate the stiffness of the environment. In this class, they are not
        used.
        """

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet that the slave half sends to the master half at this tick."""
        return new_tuple(Report, (measurement.contact_force, PRIOR, 0.0, self.tip(measurement)))

    def velocity(self, motion: MasterMotion, measurement: Measurement, dt: float) -> float:
        """Return the desired velocity of the slave [m/s], with which its tip follows the master."""
        scale = self._scale
        tip = scale * motion.position
        force, slope = self.load(tip, measurement)
        compliance = self._compliance
        goal, factor = self._tip.goal(tip, compliance * force, compliance * slope)
        error = goal - measurement.slave_position
        return scale * motion.velocity * factor + self._position_gain * error

    def load(self, tip: float, measurement: Measurement) -> tuple[float, float]:
        """Return the contact force [N] with the tip at a position [m], and its slope [N/m].

        In this class, it is the measured force, and its slope is not known.
        """
        return measurement.contact_force, 0.0

    def stiffness(self, position: float) -> float:
        """Return the expected slope of the contact force over the position of the slave [N/m].

        In this class, the slope does not depend on the position.
        """
        return self._stiffness
