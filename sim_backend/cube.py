"""Model of a soft cube. By default, the cube is glued to the slave's plate, as in the paper."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_backend.body import Body, Law


@dataclass(frozen=True)
class Cube(Law, Body):
    """Kelvin-Voigt body whose stiffness increases with depth, f = k1 x + k3 x^3 + b v.

    Parameters
    ----------
    k1
        Stiffness at small displacement [N/m], > 0.
    k3
        Stiffening coefficient [N/m^3], >= 0.
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

    preload = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.k1 < math.inf and 0.0 <= self.k3 < math.inf and 0.0 < self.b < math.inf):
            raise ValueError(f"a cube needs k1 > 0, k3 >= 0 and b > 0, got {self}")

    def law(self, state: None) -> Law:
        """Return the law of the contact force: the cube itself, because its law never changes."""
        return self

    def advanced(self, state: None, surface: float, dt: float) -> None:
        """Return None: a cube has no state, because its force does not depend on the past."""

    @property
    def slow(self) -> Law:
        """Law of the contact force in slow motion: the cube itself, also valid in fast motion."""
        return self

    @property
    def further_laws(self) -> dict[str, Law]:
        """Empty dictionary, because the law of the contact force is the same for all motions."""
        return {}
