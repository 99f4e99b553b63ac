"""Coupling: the velocity of the slave from the motion of the master."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers import Command, Measurement
from teleop.control.admittance import Admittance


@dataclass(frozen=True)
class Coupling:
    """Scaled motion of the slave.

    v_s = scale v_m + position_gain (scale x_m - x_s). With a gain of zero only the velocity is
    scaled, as in the paper. With a positive gain the slave follows the scaled position too.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """

    scale: float = 1.0
    """Slave motion for a unit of master motion, > 0."""
    position_gain: float = 0.0
    """Rate at which the slave corrects a difference in position [1/s], >= 0."""

    def __post_init__(self) -> None:
        if not 0.0 < self.scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {self.scale}")
        if not 0.0 <= self.position_gain < math.inf:
            raise ValueError(f"position gain must be >= 0, got {self.position_gain}")

    def align(self, master: Admittance, measurement: Measurement) -> None:
        """Put the virtual mass where the position of the slave needs no correction.

        Called when the drives are armed, for the first time or again. Without a force on the
        handle the command is then zero at any position of the slave.
        """
        master.align(measurement.slave_position / self.scale)

    def command(self, master: Admittance, measurement: Measurement) -> Command:
        """Return the velocities for both drives."""
        lag = self.scale * master.position - measurement.slave_position
        return Command(master.velocity, self.scale * master.velocity + self.position_gain * lag)
