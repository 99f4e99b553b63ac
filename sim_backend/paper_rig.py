"""Simulation of the set-up of the paper, calibrated to Table I of the paper.

This module contains the parameters of the cubes, of the force channel and of the transmission, and
the depths of palpation. The force channel and the slave are the same in all nine trials. The spring
force of a cube at the displacement x is k1 x + k3 x^3, and its damping is b. The force channel has
a lag tau. The transmission of the slave has the lost motion delta, which is the distance by which
the tip lags the motor because of dry friction. For a sinusoidal motion to the depth x with
amplitude A and angular frequency omega, the estimates of recursive least squares (RLS) are about

    k_hat = k1 + k3 x^2
    b_hat = b - k_hat tau - 4 k_hat delta / (pi omega A)

`python -m teleop.studies.paper.calibrate` computes k1, k3, tau and delta such that k_hat and b_hat
are the values of RLS in Table I. The docstring of `teleop.studies.paper.calibrate` lists the
assumptions about the other values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from sim_backend.bodies import AnyBody
from sim_backend.body import Law
from sim_backend.cube import Cube
from sim_backend.transmission import RIGID, Transmission

LOSS_TIME = 1.5e-3
"""Damping of the cubes divided by their stiffness k1 [s]."""


def silicone(k1: float, k3: float) -> Cube:
    """Return a cube of silicone rubber with the spring force k1 x + k3 x^3.

    k1 [N/m] is the stiffness at small displacement, and k3 [N/m^3] is the stiffening coefficient.
    The damping of the cube is `LOSS_TIME` times k1.
    """
    return Cube(k1, k3, LOSS_TIME * k1)


CUBES = {
    "soft": silicone(k1=2063.0, k3=1.643e6),
    "medium": silicone(k1=4519.0, k3=4.102e7),
    "hard": silicone(k1=7461.0, k3=9.09e10),
}
"""The three cubes, numbered 1, 2 and 3 in the paper."""

FORCE_LAG = 2.66e-3
"""Time constant of the contact force channel [s]."""

TRANSMISSION = Transmission(lost_motion=122e-6, compliance=7e-6)
"""Transmission between the encoder and the tip of the slave."""

DEPTH = {
    "hand": {"soft": 15.5e-3, "medium": 6.5e-3, "hard": 1.3e-3},
    "injector": {"soft": 10.3e-3, "medium": 4.3e-3, "hard": 0.86e-3},
}
"""Intended depth of palpation [m], by what moves the master, and by cube.

The hand moves the master in the conditions `free` and `mimic`, the PE injector in `autonomous`."""


@dataclass(frozen=True)
class Setup:
    """Properties of the simulated rig, and of the palpated body, in one trial."""

    cube: AnyBody
    """Palpated body: a cube, a body whose force relaxes, or a body that changes to another body."""
    force_lag: float
    """Time constant of the contact force channel [s]."""
    depth: float
    """Intended depth of palpation [m]."""
    transmission: Transmission = RIGID
    """Transmission between the encoder and the tip of the slave."""

    def tip(self, position: Iterable[float]) -> list[float]:
        """Compute the true positions of the slave's tip [m] from the readings of its encoder [m].

        The encoder measures the position of the motor. Lost motion and compliance of the
        transmission cause the difference to the position of the tip. The result is valid only if
        the palpated body is a cube.
        """
        played, tip = 0.0, []
        for x in position:
            played = self.transmission.play(played, x)
            tip.append(self.cube.slow.compressed(played, self.transmission.compliance))
        return tip

    def force(self, x: float) -> float:
        """Return the static force [N] of the palpated body in series with the transmission.

        x [m] is the displacement of the body plus the elastic stretch of the transmission. The
        friction in the transmission is neglected. If the body changes to another body during the
        trial, the result is the force before the change.
        """
        return self.static_force(self.cube.slow, x)

    def static_force(self, law: Law, x: float) -> float:
        """Return the static force [N] of a body in series with the transmission of the slave.

        `law` is the law of the contact force of the body. x [m] is the displacement of the body
        plus the elastic stretch of the transmission. The friction in the transmission is neglected.
        """
        return law.force(law.compressed(x, self.transmission.compliance), 0.0)

    def __post_init__(self) -> None:
        for name in ("force_lag", "depth"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")


def paper_setup(moved_by: str, cube: str) -> Setup:
    """Return the properties of rig and cube in a trial of the paper.

    `moved_by` is a key of `DEPTH`, and `cube` a key of `CUBES`.
    """
    return Setup(CUBES[cube], FORCE_LAG, DEPTH[moved_by][cube], TRANSMISSION)
