"""The paper's set-up as far as its Table I tells: cubes, force channel, lost motion, depths.

Force channel and slave are the same in all nine trials. Under a stiffening cube, a force channel
that lags by tau, and lost motion delta, the RLS rows of Table I are about k_hat = k1 + k3 x^2 and
b_hat = b - k_hat tau - 4 k_hat delta / (pi omega A) for a motion of amplitude A and angular
frequency omega. k1, k3, lag and lost motion are the output of
`python -m teleop.studies.paper.calibrate`, which states the assumptions behind the other values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sim_backend.cube import Cube
from sim_backend.transmission import RIGID, Transmission

LOSS_TIME = 1.5e-3
"""Damping of the cubes over their stiffness k1 [s]."""


def silicone(k1: float, k3: float) -> Cube:
    """Return a cube of silicone rubber."""
    return Cube(k1, k3, LOSS_TIME * k1)


CUBES = {
    "soft": silicone(k1=2063.0, k3=1.643e6),
    "medium": silicone(k1=4519.0, k3=4.102e7),
    "hard": silicone(k1=7461.0, k3=9.09e10),
}
"""The three cubes; the paper's 1, 2 and 3."""

FORCE_LAG = 2.66e-3
"""Time constant of the contact force channel [s]."""

TRANSMISSION = Transmission(lost_motion=122e-6, compliance=7e-6)
"""Between the encoder and the tip of the slave."""

DEPTH = {
    "free": {"soft": 15.5e-3, "medium": 6.5e-3, "hard": 1.3e-3},
    "mimic": {"soft": 15.5e-3, "medium": 6.5e-3, "hard": 1.3e-3},
    "autonomous": {"soft": 10.3e-3, "medium": 4.3e-3, "hard": 0.86e-3},
}
"""Depth of palpation [m] that operator or injector aims for under each condition."""


@dataclass(frozen=True)
class Setup:
    """What is palpated, through which force channel, and how deep.

    Raises
    ------
    ValueError
        The lag or the depth is not positive.
    """

    cube: Cube
    force_lag: float
    """Time constant of the contact force channel [s]."""
    depth: float
    """Depth of palpation [m] that operator or injector aims for."""
    transmission: Transmission = RIGID
    """Between the encoder and the tip of the slave."""

    def tip(self, position: Iterable[float]) -> list[float]:
        """Position of the tip [m] by a sensor there, where the encoder reads `position` [m]."""
        played, tip = 0.0, []
        for x in position:
            played = self.transmission.play(played, x)
            tip.append(self.cube.compressed(played, self.transmission.compliance))
        return tip

    def force(self, x: float) -> float:
        """Force [N] of cube and transmission in series at displacement x [m], at rest."""
        return self.cube.force(self.cube.compressed(x, self.transmission.compliance), 0.0)

    def __post_init__(self) -> None:
        for name in ("force_lag", "depth"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")


def paper_setup(condition: str, cube: str) -> Setup:
    """The paper's set-up for one of its nine trials."""
    return Setup(CUBES[cube], FORCE_LAG, DEPTH[condition][cube], TRANSMISSION)
