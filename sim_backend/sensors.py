"""Simulated imperfections of the sensors: encoder resolution, force noise and force offsets."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

FINEST, COARSEST = 1e-12, 1.0
"""Smallest and largest resolution of the encoders [m]."""


@dataclass(frozen=True)
class Sensors:
    """Parameters of the imperfections of the simulated encoders and force sensors.

    Raises
    ------
    ValueError
        `encoder_resolution` is not between `FINEST` and `COARSEST`, or `force_noise` is negative or
        not finite.
    """

    encoder_resolution: float = 1e-6
    """Resolution of the encoders [m]. Each measured position is a multiple of this length."""
    force_noise: float = 0.02
    """Standard deviation of the noise of the force sensors [N]."""
    master_zero: float = 0.0
    """Offset of the handle's force sensor [N]."""
    contact_zero: float = 0.0
    """Offset of the contact force sensor [N]."""
    contact_position: float = 0.0
    """Position that the slave's encoder measures at the contact point [m]."""

    def __post_init__(self) -> None:
        if not FINEST <= self.encoder_resolution <= COARSEST:
            raise ValueError(
                f"encoder resolution must be {FINEST:g} to {COARSEST:g} m, got "
                f"{self.encoder_resolution}"
            )
        if not 0.0 <= self.force_noise < math.inf:
            raise ValueError(f"force noise must be >= 0, got {self.force_noise}")

    def position(self, x: float) -> float:
        """Return the position [m] that an encoder measures at the true position x [m]."""
        return round(x / self.encoder_resolution) * self.encoder_resolution

    def force(self, f: float, noise: random.Random) -> float:
        """Return the true force f [N] plus noise, but without the offset of the sensor.

        Parameters
        ----------
        f
            True force on the sensor [N].
        noise
            Random generator of the noise.
        """
        return f + noise.gauss(0.0, self.force_noise)
