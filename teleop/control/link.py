"""Links between master and slave, which convert the force of the hand to desired velocities."""

from __future__ import annotations

from abc import ABC, abstractmethod

from drivers import Command, Measurement
from teleop.control.admittance import Admittance
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.safety import Verdict
from teleop.safety.channels import DetectedFault


class Link(ABC):
    """Base class of links. A link computes the desired velocities of both drives at each tick."""

    faults: tuple[DetectedFault, ...] = ()
    """Faults of the link that were detected in the last step."""
    values: tuple[float, ...] = ()
    """Values of the last step that are recorded, for the columns that the link adds."""

    @abstractmethod
    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest where its scaled position equals the slave's position."""

    @abstractmethod
    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Return the desired velocities [m/s] of both drives after `force` [N] acted for dt [s]."""

    @abstractmethod
    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle if the supervisor reduced the master's command."""

    def observe(self, pair: Pair) -> None:  # noqa: B027
        """Process a pair of slave position and contact force."""

    def stiffness(self, position: float) -> float | None:
        """Return the expected slope of the contact force [N/m] at a position of the slave [m].

        The result is None if master and slave are at the same place. The soft limits then act on
        master and slave together.
        """
        return None


class DirectLink(Link):
    """Master and slave at the same place, without force feedback.

    Parameters
    ----------
    admittance, coupling
        Virtual mass of the master, and map from the motion of the master to the motion of the
        slave.
    """

    def __init__(self, admittance: Admittance, coupling: Coupling) -> None:
        self._admittance = admittance
        self._coupling = coupling

    def align(self, measurement: Measurement) -> None:
        """Put the virtual mass at rest where its scaled position equals the slave's position."""
        self._coupling.align(self._admittance, measurement)

    def step(self, force: float, measurement: Measurement, dt: float) -> Command:
        """Return the desired velocities [m/s] of both drives after `force` [N] acted for dt [s]."""
        self._admittance.step(force, dt)
        return self._coupling.command(self._admittance, measurement)

    def follow(self, verdict: Verdict, desired: Command, applied: Command, dt: float) -> None:
        """Move the virtual mass like the handle if any soft limit reduced the command."""
        if verdict.limited:
            self._admittance.follow(applied.master_velocity, dt)
