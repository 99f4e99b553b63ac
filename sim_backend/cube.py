"""The simulated environment: a soft cube, by default glued to the slave's plate as in the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Cube:
    """Stiffening Kelvin-Voigt body, f = k1 x + k3 x^3 + b v.

    Parameters
    ----------
    k1
        Stiffness at small displacement [N/m], > 0.
    k3
        Stiffening [N/m^3], >= 0.
    b
        Damping [N s/m], > 0.
    glued
        Whether the cube is glued to the slave's plate. If it is glued, the equation is valid in
        compression and in tension. If not, the force is zero out of contact and never negative.

    Raises
    ------
    ValueError
        A parameter is out of range.
    """

    k1: float
    k3: float
    b: float
    glued: bool = True

    def __post_init__(self) -> None:
        if not (0.0 < self.k1 < math.inf and 0.0 <= self.k3 < math.inf and 0.0 < self.b < math.inf):
            raise ValueError(f"a cube needs k1 > 0, k3 >= 0 and b > 0, got {self}")

    def force(self, x: float, v: float) -> float:
        """Return the force [N] at displacement x [m] and velocity v [m/s]."""
        force = (self.k1 + self.k3 * x * x) * x + self.b * v
        return force if self.glued or (x > 0.0 and force > 0.0) else 0.0

    def stiffness(self, x: float) -> float:
        """Return the slope of the spring force [N/m] at displacement x [m]."""
        return self.k1 + 3.0 * self.k3 * x * x if self.glued or x > 0.0 else 0.0

    def compressed(self, x: float, compliance: float) -> float:
        """Return the displacement y [m] of the cube in series with a spring.

        y is the solution of x = y + c f(y, 0), with the force f(y, 0) of the cube at rest.

        Parameters
        ----------
        x
            Displacement of cube and spring together [m].
        compliance
            Compliance c of the spring [m/N], >= 0.
        """
        if not (self.glued or x > 0.0):
            return x
        linear, cubic = 1.0 + compliance * self.k1, compliance * self.k3
        alone = x / linear
        r = 1.5 * alone * math.sqrt(3.0 * cubic / linear)
        return alone * 3.0 * math.sinh(math.asinh(r) / 3.0) / r if abs(r) > 1e-9 else alone
