"""Base classes of the two halves of a force-feedback law, and the packets that they exchange.

The slave half computes a `Report` for the master from its measurements. It also computes the
desired velocity of the slave from the `Motion` that the master half sends. This motion is that of
the virtual mass. The master half computes it from the report and the force of the hand. The two
halves share no variable. The classes `Master` and `Slave` are also the law `none`, with which the
hand feels only the virtual mass.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drivers import Measurement, new_tuple
from teleop.control.admittance import Admittance, Environment
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling

STIFF_PRIOR = 20e3
"""Stiffness that is assumed for an unknown environment [N/m]. Soft tissue is less stiff."""

PASSIVE = 6e-3
"""Energy [J] that a passive law may give out before the drives are stopped.

It is the energy in the energy tank at the start, plus 1 mJ.
"""


PRIOR = Environment(STIFF_PRIOR)
"""Model of an unknown environment."""
NO_BODY = Environment(math.nan, math.nan, math.nan)
"""Model that is recorded if the hand feels no model."""


class Report(NamedTuple):
    """Packet from the slave to the master."""

    force: float = 0.0
    """Contact force [N]."""
    model: Environment = PRIOR
    """Estimated environment. Its force is a function of the displacement of the slave."""
    energy: float = 0.0
    """Energy that the environment has given to the channel since arming [J]."""


class Motion(NamedTuple):
    """Packet from the master to the slave."""

    position: float
    """Position of the virtual mass [m]."""
    velocity: float = 0.0
    """Velocity of the virtual mass [m/s]."""
    energy: float = 0.0
    """Energy that the hand has given to the channel since arming [J]."""


class MasterState(NamedTuple):
    """Recorded quantities of the master half after a tick."""

    displayed: float = 0.0
    """Force that the hand feels from the environment [N]; positive if it opposes compression."""
    model: Environment = NO_BODY
    """Environment that the hand feels, as a function of the master's displacement; NaN for no
    body."""
    tank: float = math.nan
    """Energy in the energy tank [J]; NaN if the law has no tank."""


class Master:
    """Master half of the law `none`, and base class for the other laws.

    Parameters
    ----------
    admittance
        Virtual mass of the master.
    scale
        Ratio of the motion of the slave to the motion of the master.
    gain
        Ratio alpha of the displayed force to the contact force.
    """

    allowance = PASSIVE
    """Energy [J] that the displayed environment may generate before the drives are stopped."""

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
        """Reset the state of the law; called each time the drives are armed."""
        self.state = MasterState()

    def step(self, force: float, report: Report, dt: float) -> Motion:
        """Advance the virtual mass by dt [s] under `force` [N] of the hand; return its motion."""
        displayed = self.started = self.display(report, dt)
        self.admittance.step(force - displayed, dt)
        self.state = new_tuple(MasterState, (displayed, NO_BODY, math.nan))
        return new_tuple(Motion, (self.admittance.position, self.admittance.velocity, 0.0))

    def display(self, report: Report, dt: float) -> float:
        """Return the force [N] that is subtracted from the force of the hand."""
        return 0.0


class Slave:
    """Slave half of the law `none`, and base class for the other laws.

    Parameters
    ----------
    coupling
        Maps the motion of the master to the motion of the slave.
    stiffness
        Expected slope of the contact force [N/m]. The supervisor uses it to limit the speed of the
        slave.
    """

    def __init__(self, coupling: Coupling, stiffness: float = STIFF_PRIOR) -> None:
        self._coupling = coupling
        self._stiffness = stiffness

    def align(self) -> None:
        """Reset the state of the law; called each time the drives are armed."""

    def observe(self, pair: Pair) -> None:
        """Process a pair of position and contact force."""

    def report(self, measurement: Measurement, dt: float) -> Report:
        """Return the packet for the master, computed from the measurement of the slave."""
        return new_tuple(Report, (measurement.contact_force, PRIOR, 0.0))

    def velocity(self, motion: Motion, measurement: Measurement, dt: float) -> float:
        """Return the desired velocity of the slave [m/s]."""
        return self._coupling.slave_velocity(motion, measurement)

    def stiffness(self, position: float) -> float:
        """Return the expected slope of the contact force [N/m] at a position of the slave [m]."""
        return self._stiffness
