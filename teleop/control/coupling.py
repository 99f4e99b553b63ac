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
    """Ratio of slave motion to master motion, > 0."""
    position_gain: float = 0.0
    """Gain on the difference between scaled master position and slave position [1/s], >= 0."""

    def __post_init__(self) -> None:
        if not 0.0 < self.scale < math.inf:
            raise ValueError(f"motion scale must be positive, got {self.scale}")
        if not 0.0 <= self.position_gain < math.inf:
            raise ValueError(f"position gain must be >= 0, got {self.position_gain}")

    def align(self, master: Admittance, measurement: Measurement) -> None:
        """Set the virtual mass to the position that matches the slave's.

        Called each time the drives are armed. Without a force on the handle, the command is then
        zero at any position of the slave.
        """
        master.align(measurement.slave_position / self.scale)

    def command(self, master: Admittance, measurement: Measurement) -> Command:
        """Return the desired velocities of both drives [m/s]."""
        lag = self.scale * master.position - measurement.slave_position
        return Command(master.velocity, self.scale * master.velocity + self.position_gain * lag)
