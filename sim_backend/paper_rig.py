"""The paper's set-up as far as its Table I tells: cubes, force-channel lags, depths.

Under a stiffening cube and a lagging force channel the RLS rows of Table I are about
k_hat = k1 + k3 x^2 and b_hat = b - k_hat tau. The values here are the output of
`python -m teleop.studies.paper.calibrate`. The lag of a sensor does not depend on what it
touches. One lag for each cube stands for all other differences between the trials of the paper,
and does not reproduce all of its damping values at the same time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_backend.cube import Cube
from sim_backend.transmission import RIGID, Transmission

CUBES = {
    "soft": Cube(k1=1931.0, k3=2.8e6, b=3.0),
    "medium": Cube(k1=4348.0, k3=2.42e7, b=8.0),
    "hard": Cube(k1=14410.0, k3=5.74e9, b=20.0),
}
"""The three cubes; the paper's 1, 2 and 3."""

FORCE_LAG = {"soft": 5.4e-3, "medium": 6.1e-3, "hard": 10.5e-3}
"""Time constant of the contact force channel [s] in the trials with each cube."""

DEPTH = {
    "free": {"soft": 13e-3, "medium": 7.5e-3, "hard": 2.6e-3},
    "mimic": {"soft": 13e-3, "medium": 7.5e-3, "hard": 2.6e-3},
    "autonomous": {"soft": 11e-3, "medium": 5.6e-3, "hard": 1.35e-3},
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

    def __post_init__(self) -> None:
        for name in ("force_lag", "depth"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")


def paper_setup(condition: str, cube: str) -> Setup:
    """The paper's set-up for one of its nine trials."""
    return Setup(CUBES[cube], FORCE_LAG[cube], DEPTH[condition][cube])
