"""Coupling of master and slave: compute the slave velocity from the motion of the master."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from drivers import Command, Measurement, new_tuple
from teleop.control.admittance import Admittance


class Moving(Protocol):
    """Object with a position and a velocity, for example the virtual mass of the master."""

    @property
    def position(self) -> float:
        """Position of the object [m]."""

    @property
    def velocity(self) -> float:
        """Velocity of the object [m/s]."""


@dataclass(frozen=True)
class Coupling:
    """Computes the desired velocity of the slave from the motion of the master.

    The desired velocity is v_s = scale v_m + position_gain (scale x_m - x_s), where v_m and x_m are
    velocity and position of the virtual mass of the master, and x_s is the position of the slave.
    With a position gain of zero, the slave follows the scaled velocity of the master. With a
    positive gain, the slave also follows the scaled position of the master.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    scale: float = 1.0
    """Ratio of slave motion to master motion, > 0."""
    position_gain: float = 0.0
    """Gain for the difference scale x_m - x_s [1/s], >= 0. In the paper, it is 0."""

    def __post_init__(self) -> None:
        if not 0.0 < self.scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {self.scale}")
        if not 0.0 <= self.position_gain < math.inf:
            raise ValueError(f"position gain must be >= 0, got {self.position_gain}")

    def align(self, master: Admittance, measurement: Measurement) -> None:
        """Put the virtual mass at rest where its scaled position equals the position of the slave.

        This method is called each time the drives are armed. After arming, the desired velocities
        are therefore zero, until a force acts on the handle.
        """
        master.align(measurement.slave_position / self.scale)

    def command(self, master: Moving, measurement: Measurement) -> Command:
        """Return the desired velocities of the master and the slave [m/s].

        The master velocity is the velocity of the object `master` (the virtual mass). The
        measurement contains the position of the slave.
        """
        return new_tuple(Command, (master.velocity, self.slave_velocity(master, measurement)))

    def slave_velocity(self, master: Moving, measurement: Measurement) -> float:
        """Return the desired velocity of the slave [m/s]."""
        scale = self.scale
        lag = scale * master.position - measurement.slave_position
        return scale * master.velocity + self.position_gain * lag
