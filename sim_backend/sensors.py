"""Sensors as they are: an encoder counts, a force sensor has noise."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass


@dataclass(frozen=True)
class Sensors:
    """Imperfections of the sensors.

    Raises
    ------
    ValueError
        A value is negative or, for the resolution, zero.
    """

    encoder_resolution: float = 1e-6
    """Position of one encoder count [m]."""
    force_noise: float = 0.02
    """Standard deviation of a force sample [N]."""
    master_zero: float = 0.0
    """What the handle's force sensor reads at no force [N]."""
    contact_zero: float = 0.0
    """What the contact force sensor reads at no force [N]."""
    contact_position: float = 0.0
    """What the slave's encoder reads where contact begins [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.encoder_resolution < math.inf:
            raise ValueError(f"encoder resolution must be positive, got {self.encoder_resolution}")
        if not 0.0 <= self.force_noise < math.inf:
            raise ValueError(f"force noise must be >= 0, got {self.force_noise}")

    def position(self, x: float) -> float:
        """What the encoder reads at position x [m]."""
        return round(x / self.encoder_resolution) * self.encoder_resolution

    def force(self, f: float, noise: random.Random) -> float:
        """What the force sensor reads at force f [N]."""
        return f + noise.gauss(0.0, self.force_noise)
