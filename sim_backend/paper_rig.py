"""The paper's set-up as far as its Table I tells: cubes, force-channel lags, depths.

Read off the RLS rows of Table I under a stiffening cube, k_hat ~ k1 + k3 x^2, and a lagging
force channel, b_hat ~ b - k_hat tau.
"""

from __future__ import annotations

from sim_backend.cube import Cube

CUBES = {
    "soft": Cube(k1=2000.0, k3=3e6, b=3.0),
    "medium": Cube(k1=4400.0, k3=3e7, b=8.0),
    "hard": Cube(k1=18000.0, k3=3e9, b=20.0),
}
"""The three cubes; the paper's 1, 2 and 3."""

FORCE_LAG = {"soft": 5.6e-3, "medium": 5.5e-3, "hard": 14.9e-3}
"""Time constant of the contact force channel [s] in the trials with each cube."""

DEPTH = {
    "free": {"soft": 9e-3, "medium": 6e-3, "hard": 2.5e-3},
    "mimic": {"soft": 11e-3, "medium": 5e-3, "hard": 2.2e-3},
    "autonomous": {"soft": 6e-3, "medium": 3e-3, "hard": 0.9e-3},
}
"""Greatest depth of palpation [m] under each condition."""
