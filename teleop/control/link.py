"""Define the link between master and slave, which computes the desired velocities of both drives.

The force of the hand, or the force of the excitation, moves the virtual mass of the admittance. The
velocity of the virtual mass is the desired velocity of the master. From the motion of the virtual
mass, the link also computes the desired velocity of the slave.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from drivers import Command, Measurement
from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.safety import Verdict
from teleop.safety.channels import DetectedFault


@dataclass(frozen=True)
class LinkSettings:
    """Settings of a trial that a link may use."""

    admittance: AdmittanceParameters
    """Mass, damping and stiffness of the virtual dynamics of the master."""
    coupling: Coupling
    """Ratio of slave motion to master motion, and position gain."""
    period: float
    """Nominal time between ticks [s]."""


class Link(ABC):
    """Base class of links, which compute the desired velocities of master and slave.

    A class of the user needs `align`, `step` and `follow`.
    """

    faults: tuple[DetectedFault, ...] = ()
    """Faults that the link detected in the last call of `step`."""
    values: tuple[float, ...] = ()
    """Recorded values of the last call of `step`, one for each column that the link adds to a
    recording."""

    def prepare(self, settings: LinkSettings) -> None:  # noqa: B027
        """Prepare a trial with these settings. It is called once, before the first tick."""

    def sense(self, measurement: Measurement, dt: float) -> None:  # noqa: B027
        """Process the measurement of a tick, also while the drives are not armed.

        The controller calls this method before the others. The base class does nothing.
        """

    @abstractmethod
    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest at the position that corresponds to that of the slave.

        The controller calls this method each time the drives are armed. The position of the virtual
        mass becomes the position of the slave divided by the motion scale (ratio of slave motion to
        master motion).
        """

    @abstractmethod
    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Move the virtual mass, and return the desired velocities [m/s] of master and slave."""

    @abstractmethod
    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Correct the motion of the virtual mass if the supervisor reduced the master's velocity.

        If the safety supervisor limits the velocity of the handle (the master), the virtual mass is
        given the same velocity.
        """

    def observe(self, pair: Pair) -> None:  # noqa: B027
        """Process a slave position and a contact force that were measured at the same time.

        A link can use them to estimate the stiffness. The base class does nothing.
        """

    def stiffness(self, position: float) -> float | None:
        """Return how much the contact force is expected to change per change of the slave position.

        If the result is None, the supervisor reduces the velocities of master and slave by the same
        factor. Otherwise, it limits them separately.
        """
        return None


class DirectLink(Link):
    """Link without a communication channel and without force feedback.

    Parameters
    ----------
    admittance
        Virtual mass, which converts the force on it to the desired velocity of the master.
    coupling
        Computes the desired velocity of the slave from the motion of the virtual mass.
    """

    def __init__(self, admittance: Admittance, coupling: Coupling) -> None:
        self._admittance = admittance
        self._coupling = coupling

    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest at the position that corresponds to that of the slave.

        The position of the virtual mass becomes the position of the slave divided by the motion
        scale (ratio of slave motion to master motion).
        """
        self._coupling.align(self._admittance, measurement)

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Move the virtual mass, and return the desired velocities [m/s] of master and slave."""
        self._admittance.step(force, dt)
        return self._coupling.command(self._admittance, measurement)

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Give the virtual mass the velocity of the handle if a soft limit reduced the velocities.

        The soft limits are limits of the safety supervisor that reduce the desired velocities.
        """
        if verdict.limited:
            self._admittance.follow(applied.master_velocity, dt)
