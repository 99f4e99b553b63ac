"""Sensor imperfections: quantisation of the encoder, noise and offset of the force sensors."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass


@dataclass(frozen=True)
class Sensors:
    """Parameters of the sensor imperfections.

    Raises
    ------
    ValueError
        The encoder resolution is not positive, or the force noise is negative.
    """

    encoder_resolution: float = 1e-6
    """Distance per count of each encoder [m]."""
    force_noise: float = 0.02
    """Standard deviation of the noise of a force sample [N]."""
    master_zero: float = 0.0
    """Offset of the handle's force sensor [N]."""
    contact_zero: float = 0.0
    """Offset of the contact force sensor [N]."""
    contact_position: float = 0.0
    """Reading of the slave's encoder at the contact point [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.encoder_resolution < math.inf:
            raise ValueError(f"encoder resolution must be positive, got {self.encoder_resolution}")
        if not 0.0 <= self.force_noise < math.inf:
            raise ValueError(f"force noise must be >= 0, got {self.force_noise}")

    def position(self, x: float) -> float:
        """Return the reading of the encoder at position x [m]."""
        return round(x / self.encoder_resolution) * self.encoder_resolution

    def force(self, f: float, noise: random.Random) -> float:
        """Return the reading of a force sensor [N] at force f [N], with noise but without offset.

        `noise` is the random generator of the noise.
        """
        return f + noise.gauss(0.0, self.force_noise)
