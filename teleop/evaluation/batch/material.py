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
m / h. On a layer, a sphere or a cone has a larger contact radius at the same depth than on a
half-space. With the right side d - c t^p instead of 1 (sphere: c = a^2 / R and p = 2; cone:
c = (pi / 2) a cot(alpha) and p = 1), the pressure is finite at the edge of the contact if
phi(1) = 0. This gives the depth d and the force 2 a E* int_0^1 phi dt for each contact radius a.

For a flat punch, E is computed from the tangent stiffness. For a sphere or a cone, the law of the
contact is fitted to the samples:

    f = f0 + E* g(d) + c g(d) v,    d = max(x - x0, 0)

g(d) is the force for E* = 1. f0 is the force out of contact, x0 is the contact point, v is the
speed, and c is the damping, which grows with the depth as in the model of Hunt and Crossley. The
tangent stiffness is not used, because damping that grows with depth, and the curvature of the law,
change it, and because its depth has the error of a contact point that was found without the law.

References
----------
I. N. Sneddon, "The relation between load and penetration in the axisymmetric Boussinesq problem for
a punch of arbitrary profile", Int. J. Engineering Science 3(1), 1965; K. L. Johnson, "Contact
Mechanics", Cambridge, 1985 (chapter 4, Hertz); W. C. Hayes, L. M. Keer, G. Herrmann, L. F. Mockros,
"A mathematical analysis for indentation tests of articular cartilage", J. Biomechanics 5(5), 1972.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.robust_error import robust_fit
from estimation.stiffening import Interval
from teleop.errors import InputError
from teleop.evaluation.batch.analysis import Analysis
from teleop.evaluation.batch.stiffness_result import StiffnessResult

IndenterName = Literal["flat", "sphere", "cone"]

LAYER_RADII = 25
"""Number of contact radii at which the force on a layer is computed. Between them, it is
interpolated."""

FEWEST_LAW_SAMPLES = 20
"""Smallest number of samples to which the law of the contact is fitted."""


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
            raise InputError(f"--indenter {self.shape}: expected --radius above zero, such as 5mm")
        if self.thickness is not None and not self.thickness > 0.0:
            raise InputError("--thickness: expected a thickness above zero, such as 20mm")
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


def layer_equation(
    aspect: float, poisson: float, nodes: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return nodes and weights in (0, 1), and the equation of the contact with a layer.

    The equation has the values of phi at the nodes as its unknowns. Its matrix has the shape
    (`nodes`, `nodes`). The last array is the row with which phi(1) is computed from phi at the
    nodes. `aspect` is the contact radius divided by the thickness.
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
    cosines = np.cos(aspect * np.append(s, 1.0)[:, None] * m)
    rest[[0, -1]] *= 0.5
    both = 2.0 * (m[1] - m[0]) * (cosines * rest) @ cosines[:-1].T
    kernel = aspect / math.pi * both * weights
    return s, weights, np.eye(nodes) - kernel[:-1], kernel[-1]


def hayes_factor(aspect: float, poisson: float, nodes: int = 48) -> float:
    """Return Hayes' factor: the stiffness of a layer divided by the stiffness of a half-space.

    The layer is bonded to a rigid base, and a flat punch presses on it. The half-space is of the
    same material. The factor is larger than 1. `aspect` is the contact radius divided by the
    thickness. The integral equation is solved at `nodes` nodes of the Gauss-Legendre quadrature.
    """
    _, weights, matrix, _ = layer_equation(aspect, poisson, nodes)
    return float(weights @ np.linalg.solve(matrix, np.ones(nodes)))


def layer_contact(
    aspect: float, poisson: float, power: int, nodes: int = 48
) -> tuple[float, float]:
    """Return depth and force of a sphere or a cone on a layer, relative to those on a half-space.

    The contact radius is the same on the layer and on the half-space. `aspect` is this radius
    divided by the thickness. The profile of the tip is proportional to the radius to the power
    `power`: 2 for a sphere, 1 for a cone.
    """
    s, weights, matrix, last = layer_equation(aspect, poisson, nodes)
    flat, tip = np.linalg.solve(matrix, np.column_stack([np.ones(nodes), s**power])).T
    depth = (1.0 + last @ tip) / (1.0 + last @ flat)
    force = weights @ (depth * flat - tip)
    return float(depth), float(force) * (1.0 + power) / power


def elastic_modulus(
    analysis: Analysis, indenter: Indenter, stated: tuple[float, float] | None = None
) -> dict[str, Any]:
    """Return the elastic modulus [Pa] with its 95 % interval, as a dictionary for JSON.

    For a flat punch, the modulus is computed from the stiffness. For a sphere or a cone, the law of
    the contact is fitted (`fit_contact_law`). This needs the contact point. If the record does not
    contain it, it is the point `stated`: its position [m] and the force out of contact [N]. The
    interval does not include errors of the dimensions of the tip, nor of a stated point.
    """
    result = analysis.result
    if result.k is None:
        raise InputError("elastic modulus: no stiffness is identifiable from the record")
    if indenter.shape == "flat":
        a, found, depth = indenter.contact_radius(0.0), from_stiffness(result, indenter), 0.0
    else:
        law = fit_contact_law(analysis, indenter, stated)
        found, depth = law.modulus, law.depth
        a = contact_radius_at(indenter, depth)
    factor = 1.0
    method = {"flat": "Sneddon", "sphere": "Hertz", "cone": "Sneddon"}[indenter.shape]
    method = f"{method}, {indenter.shape}, contact radius {a * 1e3:.3g} mm"
    if indenter.shape != "flat":
        method += " at the largest depth"
    if indenter.thickness is None:
        method += ", half-space"
    elif indenter.shape == "flat":
        factor = hayes_factor(a / indenter.thickness, indenter.poisson)
        method += f", Hayes' factor {factor:.3g}"
    else:
        plain = force_law(replace(indenter, thickness=None), depth)
        at = np.array([depth])
        factor = float(force_law(indenter, depth)(at)[0] / plain(at)[0])
        method += f", Hayes' layer: {factor:.3g} times the force of a half-space"
    document = {
        "modulus_pa": found.value,
        "modulus_low_pa": found.low,
        "modulus_high_pa": found.high,
        "poisson": indenter.poisson,
        "contact_radius_m": a,
        "hayes_factor": factor,
        "method": method,
    }
    if indenter.shape != "flat":
        document |= {
            "depth_m": depth,
            "contact_point_m": law.point,
            "fit_rms_n": law.rms,
            "fit_r2": law.r2,
        }
    return document


def from_stiffness(result: StiffnessResult, indenter: Indenter) -> Interval:
    """Return the elastic modulus [Pa] that a flat punch measures, from the stiffness at the tip."""
    a = indenter.contact_radius(0.0)
    factor = 1.0
    if indenter.thickness is not None:
        factor = hayes_factor(a / indenter.thickness, indenter.poisson)
    each = (1.0 - indenter.poisson**2) / (2.0 * a * factor)
    assert result.k is not None
    k = result.k_tip or Interval(result.k, *result.interval("k"))
    return Interval(*(each * value for value in k))


class ContactLaw(NamedTuple):
    """Fit of the law of the contact of a sphere or a cone."""

    modulus: Interval
    """Elastic modulus with its 95 % interval [Pa]."""
    point: float
    """Position of the contact point [m]."""
    depth: float
    """Largest depth of the fitted samples [m]."""
    rms: float
    """Root mean square of the residual of the force [N]."""
    r2: float
    """Coefficient of determination of the fit."""


def fit_contact_law(
    analysis: Analysis, indenter: Indenter, stated: tuple[float, float] | None = None
) -> ContactLaw:
    """Fit the law of the contact to the loading and unloading of a record, and to the approach.

    The samples are not smoothed, because the law is not linear. The position is that of the tip: if
    the compliance of the transmission is known, its deformation is subtracted. Holds are not
    fitted, because the force relaxes in them. Without a contact point in the record, the contact
    point is `stated`, as in `elastic_modulus`.
    """
    record, phases = analysis.record, analysis.phases
    point, level = phases.contact_point, phases.free_force
    x, f = record.raw_x, record.raw_f
    if point is None and stated is None:
        raise InputError(
            f"elastic modulus with a {indenter.shape}: the depth is not known, because the record "
            "has no contact point: expected a record that begins or ends out of contact, or a "
            "datum at the contact point"
        )
    about = level if stated is None or point is not None else stated[1]
    x = x - analysis.transmission.compliance * (f - (about or 0.0))
    first = point.value if point is not None else stated[0] if stated else 0.0
    depth = float(x.max()) - first
    if depth <= 0.0:
        raise InputError(
            f"elastic modulus with a {indenter.shape}: the position is never deeper than the "
            "contact point"
        )
    used = x > first - depth
    for phase in phases.phases:
        if phase.name == "hold":
            used[phase.start : phase.end] = False
    x, v, f = x[used], record.v[used], f[used]
    if len(x) < FEWEST_LAW_SAMPLES:
        raise InputError(f"elastic modulus: only {len(x)} samples in loading and unloading")
    law = force_law(indenter, 2.0 * depth)

    def columns(zero: float) -> Floats:
        """Return the regressors of E*, c and, without a stated datum, f0."""
        shape = law(np.maximum(x - zero, 0.0))
        found = [shape, shape * v]
        return np.column_stack(found if point is None else [*found, np.ones(len(x))])

    force = f - stated[1] if point is None and stated else f

    def squares(zero: float) -> float:
        each = columns(zero)
        scaled = each / np.maximum(np.abs(each).max(axis=0), 1e-300)
        residual = force - scaled @ np.linalg.lstsq(scaled, force, rcond=None)[0]
        return float(residual @ residual)

    zero = first
    if point is not None:
        grid = np.linspace(first - 0.5 * depth, first + 0.5 * depth, 41)
        best = grid[int(np.argmin([squares(one) for one in grid]))]
        near = grid[1] - grid[0]
        zero = float(
            minimize_scalar(
                squares,
                bounds=(best - near, best + near),
                method="bounded",
                options={"xatol": 1e-7 * depth},
            ).x
        )
    jacobian = columns(zero)
    size = np.maximum(np.abs(jacobian).max(axis=0), 1e-300)
    theta = np.linalg.lstsq(jacobian / size, force, rcond=None)[0] / size
    residual = force - jacobian @ theta
    if point is not None:  # the contact point is the fourth parameter
        step = 1e-4 * depth
        slope = (columns(zero + step) - columns(zero - step)) @ theta / (2.0 * step)
        jacobian = np.column_stack([jacobian, slope])
    chosen = np.zeros(jacobian.shape[1])
    chosen[0] = 1.0
    plane = 1.0 - indenter.poisson**2
    value = plane * float(theta[0])
    half = LEVEL_95 * plane * robust_fit(jacobian, force).deviation(chosen)
    rms = math.sqrt(float(np.mean(residual**2)))
    return ContactLaw(
        Interval(value, value - half, value + half),
        zero,
        float(x.max()) - zero,
        rms,
        1.0 - rms**2 / max(float(np.var(force)), 1e-300),
    )


def force_law(indenter: Indenter, deepest: float) -> Callable[[Floats], Floats]:
    """Return the force per E* [m^2] as a function of the depth, up to the depth `deepest` [m]."""
    if indenter.thickness is None:
        if indenter.shape == "sphere":
            each, power = 4.0 / 3.0 * indenter.contact_radius(1.0), 1.5
        else:
            each, power = indenter.contact_radius(1.0), 2.0
        return lambda depth: np.asarray(each * depth**power)
    # The ratio to the force of a half-space is a smooth function of the root of the depth.
    depths, _, ratio = layer_table(indenter, deepest)
    plain = force_law(replace(indenter, thickness=None), deepest)
    smooth = CubicSpline(np.sqrt(depths), ratio)
    return lambda depth: np.asarray(plain(depth) * smooth(np.sqrt(depth)))


def layer_table(indenter: Indenter, deepest: float) -> tuple[Floats, Floats, Floats]:
    """Return depths [m] in a layer, the contact radii there [m], and the ratios of the force.

    The ratio is that of the force on the layer to the force on a half-space at the same depth. The
    largest depth is at least `deepest`.
    """
    assert indenter.thickness is not None
    power = 2 if indenter.shape == "sphere" else 1
    # on a thin layer, the contact radius at the same depth is up to 2.3 times as large
    largest = 2.5 * indenter.contact_radius(deepest)
    radii = largest * np.linspace(0.0, 1.0, LAYER_RADII)[1:]
    on_half_space = half_space_depth(indenter, radii)
    depth, force = np.array(
        [layer_contact(a / indenter.thickness, indenter.poisson, power) for a in radii]
    ).T
    # at the same depth, the force on a half-space has the power (1 + power) / power of the depth
    ratio = force / depth ** ((1.0 + power) / power)
    start = np.zeros(1)
    return (
        np.concatenate([start, depth * on_half_space]),
        np.concatenate([start, radii]),
        np.concatenate([start + 1.0, ratio]),
    )


def half_space_depth(indenter: Indenter, radii: Floats) -> Floats:
    """Return the depth at which a sphere or a cone has each contact radius on a half-space [m]."""
    if indenter.shape == "sphere":
        assert indenter.radius is not None
        return np.asarray(radii**2 / indenter.radius)
    return np.asarray(radii / indenter.contact_radius(1.0))


def contact_radius_at(indenter: Indenter, depth: float) -> float:
    """Return the contact radius of a sphere or a cone at a depth, on a layer or half-space [m]."""
    if indenter.thickness is None:
        return indenter.contact_radius(depth)
    depths, radii, _ = layer_table(indenter, depth)
    return float(CubicSpline(np.sqrt(depths), radii)(math.sqrt(depth)))
