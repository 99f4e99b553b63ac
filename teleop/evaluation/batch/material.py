"""Compute the elastic modulus of a specimen from its stiffness and the shape of the indenter.

The indenter is the tip that presses on the specimen.

E is the elastic modulus, and nu is Poisson's ratio. With E* = E / (1 - nu^2), the tangent stiffness
k at the indentation depth d is

- flat punch of radius a (Sneddon): k = 2 a E*;
- sphere of radius R (Hertz): k = 2 E* sqrt(R d), with the contact radius a = sqrt(R d);
- cone of half angle alpha (Sneddon): k = (4 / pi) E* tan(alpha) d, with the contact radius
  a = (2 / pi) tan(alpha) d.

In all three cases, k = 2 a E* with the contact radius a. These formulas hold for a half-space, a
specimen that is much thicker than a. A layer of thickness h that is bonded to a rigid base is
stiffer. For a flat punch, k = 2 a kappa E* with Hayes' factor kappa(a / h, nu). This factor is
computed from the integral equation

    phi(t) - (a / pi h) int_-1^1 K(a (t - s) / h) phi(s) ds = 1,    kappa = int_0^1 phi dt

with K(u) = int_0^inf (1 - L(m)) cos(m u) dm. L(m) is the compliance of the layer divided by the
compliance of a half-space, for a pressure that is sinusoidal over the surface with the wave number
m / h. For a sphere or a cone, the same kappa, with the contact radius a, is an approximation.

References
----------
I. N. Sneddon, "The relation between load and penetration in the axisymmetric Boussinesq problem for
a punch of arbitrary profile", Int. J. Engineering Science 3(1), 1965; K. L. Johnson, "Contact
Mechanics", Cambridge, 1985 (chapter 4, Hertz); W. C. Hayes, L. M. Keer, G. Herrmann, L. F. Mockros,
"A mathematical analysis for indentation tests of articular cartilage", J. Biomechanics 5(5), 1972.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from teleop.errors import InputError
from teleop.evaluation.batch.stiffness_result import StiffnessResult

IndenterName = Literal["flat", "sphere", "cone"]


@dataclass(frozen=True)
class Indenter:
    """Shape and size of the tip, and thickness and Poisson's ratio of the specimen."""

    shape: IndenterName
    """Shape of the tip: flat punch, sphere or cone."""
    radius: float | None = None
    """Radius of a flat punch or a sphere [m]."""
    angle: float | None = None
    """Half angle of a cone, between axis and side [rad]."""
    thickness: float | None = None
    """Thickness of the specimen on a rigid base [m]; None for a half-space."""
    poisson: float = 0.5
    """Poisson's ratio of the specimen."""

    def __post_init__(self) -> None:
        if self.shape == "cone":
            if self.angle is None or not 0.0 < self.angle < 0.5 * math.pi:
                raise InputError("--indenter cone: expected --angle between 0 and 90 degrees")
        elif self.radius is None or not self.radius > 0.0:
            raise InputError(f"--indenter {self.shape}: expected --radius above zero, in mm")
        if self.thickness is not None and not self.thickness > 0.0:
            raise InputError("--thickness: expected a thickness above zero, in mm")
        if not 0.0 <= self.poisson <= 0.5:
            raise InputError("--poisson: expected a ratio from 0 to 0.5")

    def contact_radius(self, depth: float) -> float:
        """Return the radius of the contact area [m]. `depth` is the indentation depth [m]."""
        if self.shape == "flat":
            assert self.radius is not None
            return self.radius
        if self.shape == "sphere":
            assert self.radius is not None
            return math.sqrt(self.radius * max(depth, 0.0))
        assert self.angle is not None
        return 2.0 / math.pi * math.tan(self.angle) * max(depth, 0.0)


def hayes_factor(aspect: float, poisson: float, nodes: int = 48) -> float:
    """Return Hayes' factor: the stiffness of a layer divided by the stiffness of a half-space.

    The layer is bonded to a rigid base, and a flat punch presses on it. The half-space is of the
    same material. The factor is larger than 1. `aspect` is the contact radius divided by the
    thickness. The integral equation is solved at `nodes` nodes of the Gauss-Legendre quadrature.
    """
    kolosov = 3.0 - 4.0 * poisson
    m = np.linspace(0.0, 30.0, 3001)
    decay = np.exp(-2.0 * m)
    upper = kolosov * (1.0 - decay**2) - 4.0 * m * decay
    lower = kolosov * (1.0 + decay**2) + (4.0 * m**2 + 1.0 + kolosov**2) * decay
    rest = 1.0 - upper / lower
    s, weights = np.polynomial.legendre.leggauss(nodes)
    s, weights = 0.5 * (s + 1.0), 0.5 * weights
    # The kernel is the integral of rest(m) (cos(m (s - t)) + cos(m (s + t))), by the trapezoidal
    # rule, and cos(a - b) + cos(a + b) = 2 cos(a) cos(b).
    cosines = np.cos(aspect * s[:, None] * m)
    rest[[0, -1]] *= 0.5
    both = 2.0 * (m[1] - m[0]) * (cosines * rest) @ cosines.T
    phi = np.linalg.solve(np.eye(nodes) - aspect / math.pi * both * weights, np.ones(nodes))
    return float(weights @ phi)


def modulus_per_stiffness(indenter: Indenter, depth: float) -> float:
    """Return the ratio of the elastic modulus to the stiffness at an indentation depth [1/m].

    The modulus is the product of this ratio and the tangent stiffness.
    """
    a = indenter.contact_radius(depth)
    layer = indenter.thickness
    factor = 1.0 if layer is None else hayes_factor(a / layer, indenter.poisson)
    return (1.0 - indenter.poisson**2) / (2.0 * a * factor)


def elastic_modulus(
    result: StiffnessResult, indenter: Indenter, depth_known: bool
) -> dict[str, Any]:
    """Return the elastic modulus [Pa] with its 95 % interval, as a dictionary for JSON.

    The interval includes the errors of the stiffness and of the contact point, combined as
    independent errors. It does not include errors of the dimensions of the tip. For a sphere or a
    cone, the depth must be measured from the contact point (`depth_known`), because the contact
    radius depends on it.
    """
    if result.k is None or result.k_low is None or result.k_high is None:
        raise InputError("elastic modulus: no stiffness is identifiable from the record")
    depth = result.depth or 0.0
    if indenter.shape != "flat" and not (depth_known and depth > 0.0):
        raise InputError(
            f"elastic modulus with a {indenter.shape}: the depth is not known, because the record "
            "has no contact point: expected a record that begins or ends out of contact"
        )
    a = indenter.contact_radius(depth)
    factor = 1.0
    method = {"flat": "Sneddon", "sphere": "Hertz", "cone": "Sneddon"}[indenter.shape]
    method = f"{method}, {indenter.shape}, contact radius {a * 1e3:.3g} mm"
    if indenter.thickness is not None:
        factor = hayes_factor(a / indenter.thickness, indenter.poisson)
        approximate = "" if indenter.shape == "flat" else ", approximate for this shape"
        method += f", Hayes' factor {factor:.3g}{approximate}"
    else:
        method += ", half-space"
    per_stiffness = modulus_per_stiffness(indenter, depth)
    modulus = result.k * per_stiffness
    low = high = 0.0
    if indenter.shape != "flat":
        shallow, deep = depth - result.depth_error, depth + result.depth_error
        if shallow <= 0.0:
            raise InputError(
                f"elastic modulus with a {indenter.shape}: the error of the contact point, "
                f"{result.depth_error * 1e3:.2g} mm, is larger than the depth of "
                f"{depth * 1e3:.2g} mm"
            )
        low = modulus - result.k * modulus_per_stiffness(indenter, deep)
        high = result.k * modulus_per_stiffness(indenter, shallow) - modulus
    return {
        "modulus_pa": modulus,
        "modulus_low_pa": modulus - math.hypot((result.k - result.k_low) * per_stiffness, low),
        "modulus_high_pa": modulus + math.hypot((result.k_high - result.k) * per_stiffness, high),
        "poisson": indenter.poisson,
        "contact_radius_m": a,
        "hayes_factor": factor,
        "method": method,
    }
