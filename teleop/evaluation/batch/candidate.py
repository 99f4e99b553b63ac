"""Fit one candidate model of the contact force, and compute the stiffness of this model.

The candidate models differ in the degree of a polynomial P(x), in the number of relaxing parts (see
`teleop.evaluation.batch.local_stiffness`) and in their extensions
(`teleop.evaluation.batch.extensions`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from estimation.arrays import Floats
from estimation.estimator import LEVEL_95
from estimation.robust_error import bayesian_criterion
from teleop.evaluation.batch.friction import friction_forces
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    FEWEST_SLOPE_SAMPLES,
    FRICTION_FORM_ERROR,
    LEAST_SLOPE_STEP_NOISE,
    NOTABLE_STIFFENING,
    SLOPE_BAND,
    SMOOTHING_ERROR,
)

KNOT = "knot"
DEPTH_DAMPING = "depth damping"
MASS = "mass"
FRICTION = "friction"
"""Kinds of extension of a model."""


NO_ERRORS = np.zeros((2, 2))


class Extension(NamedTuple):
    """A part of the force besides polynomial, damping and relaxing parts."""

    kind: str
    """Kind: `KNOT`, `DEPTH_DAMPING`, `MASS` or `FRICTION`."""
    values: tuple[float, ...]
    """Normalised position and width of a knot; slip of the friction [m]; number of columns of the
    damping that depends on depth; empty for a mass."""
    columns: tuple[Floats, ...]
    """Regressors at the fitted samples."""


class Sine(NamedTuple):
    """The frequency at which a linear model with relaxing parts has its k' and k''."""

    omega: float
    """Angular frequency [rad/s]."""
    size: float
    """Displacement for which the relaxing parts are computed [m]: they are those of x / size."""


class Value(NamedTuple):
    """An estimate with its standard deviation."""

    value: float
    std: float

    @property
    def interval(self) -> dict[str, float]:
        """The value with the ends of its 95 % interval, for JSON."""
        half = LEVEL_95 * self.std
        return {"value": self.value, "low": self.value - half, "high": self.value + half}


class FittedPart(NamedTuple):
    """The physical quantities of a fitted extension, in SI units.

    A knot has its position, and the stiffness before and after it. Damping that depends on depth
    has its value at the lowest, the middle and the highest position. Friction has its force,
    and a mass has one value.
    """

    kind: str
    values: tuple[Value, ...]


class Candidate(NamedTuple):
    """A model of the contact force that was fitted to the record, with its k and b.

    The model is f = baseline + P(x) + b v + relaxing parts
    (`teleop.evaluation.batch.local_stiffness`). Models of different degree or with different
    relaxing parts are fitted to the same record. Therefore, each of them is called a candidate.
    """

    degree: int
    """Degree of the polynomial P."""
    times: tuple[float, ...]
    """Time constants of the relaxing parts of the force [s]; empty without relaxing parts."""
    bic: float
    """Bayesian information criterion of the fit."""
    k: float
    """Stiffness in loading, at half of the force range [N/m]."""
    k_std: float
    """Standard deviation of k [N/m]."""
    b: float
    """Damping [N s/m]."""
    b_std: float
    """Standard deviation of b [N s/m]."""
    rms: float
    """Root mean square of the residual [N]."""
    position: float
    """Position at which k is the stiffness [m]."""
    force: float
    """Force at half of the force range, including the mean of the baseline [N]."""
    theta: Floats
    """Coefficients of the regressors, in this order: baseline, velocity, powers of the normalised
    position, relaxing parts, columns of the extension."""
    relaxing: Sequence[Floats]
    """Relaxing parts of the force after smoothing, each of shape (n,)."""
    cornered: Sequence[Floats]
    """Relaxing parts of the force, not smoothed at their sharp corners, each of shape (n,)."""
    residual: Floats
    """Residual of the fit [N], at the fitted samples."""
    stiffening: float = 0.0
    """Second derivative of P, with a knot, to the position, at the position of k [N/m^2]."""
    extensions: tuple[Extension, ...] = ()
    """Knot, damping that depends on depth, mass and friction in the model."""
    parts: tuple[FittedPart, ...] = ()
    """Physical quantities of the extensions."""
    share_before_knot: float = 1.0
    """Increase of P from the lowest position to a knot, as a fraction of the elastic force."""
    is_storage: bool = False
    """Whether k and b are k' and k''/omega of a linear body that relaxes."""
    by_transmission: Floats = NO_ERRORS
    """Change of k, and of b (rows), per error of the calibrated lag, and of the lost motion."""

    @property
    def parameters(self) -> int:
        """Number of fitted parameters."""
        # the second column of a knot or of friction stands for its position or slip
        return len(self.theta) + len(self.times)

    @property
    def powers(self) -> Floats:
        """Coefficients of the powers 1, 2, ... of the normalised position in P [N]."""
        return self.theta[self._first_relaxing - self.degree : self._first_relaxing]

    @property
    def relaxing_force(self) -> Floats:
        """Sum of the relaxing parts after smoothing [N], shape (n,); one 0 without such parts."""
        coefficients = self.theta[self._first_relaxing :][: len(self.relaxing)]
        parts = (c * z for c, z in zip(coefficients, self.relaxing, strict=True))
        return np.asarray(sum(parts, start=np.zeros(1)))

    @property
    def relaxing_sizes(self) -> Floats:
        """Standard deviations of the relaxing parts [N], one for each time constant."""
        coefficients = self.theta[self._first_relaxing :][: len(self.times)]
        return np.array(
            [abs(c) * np.std(z) for c, z in zip(coefficients, self.relaxing, strict=False)]
        )

    @property
    def extended(self) -> int:
        """Number of columns of the extensions."""
        return sum(len(one.columns) for one in self.extensions)

    @property
    def _first_relaxing(self) -> int:
        return len(self.theta) - self.extended - len(self.relaxing)

    @property
    def change_of_stiffness(self) -> float:
        """Change of the slope of P over the middle half of the travel, relative to its mean."""
        order = np.arange(1, self.degree + 1)
        slopes = np.linspace(-0.5, 0.5, 11)[:, None] ** (order - 1) @ (order * self.powers)
        return float(np.ptp(slopes) / max(abs(float(slopes.mean())), 1e-300))

    @property
    def stiffens(self) -> bool:
        """Whether the stiffness changes notably with depth, by the polynomial or at a knot."""
        knot = self.part(KNOT)
        if knot is not None:
            low, high = sorted(one.value for one in knot.values[1:])
            if high > (1.0 + NOTABLE_STIFFENING) * low:
                return True
        return self.change_of_stiffness > NOTABLE_STIFFENING

    def force_without_mass_and_friction(self, record: SmoothedRecord) -> Floats:
        """Return the force of a record without those of mass and friction [N], shape (n,)."""
        force = record.f
        if mass := self.part(MASS):
            force = force - mass.values[0].value * record.derivative(record.v)
        if friction := self.part(FRICTION):
            (slips,) = (one.values for one in self.extensions if one.kind == FRICTION)
            (relative,) = friction_forces(record, np.array(slips))
            force = force - friction.values[0].value * record.smoothed(relative)
        return force

    def part(self, kind: str) -> FittedPart | None:
        """Return the physical quantities of one kind of extension; None without this kind."""
        return next((one for one in self.parts if one.kind == kind), None)


def fit_candidate(
    rows: RegressionRows,
    degree: int,
    times: tuple[float, ...],
    relaxing: Sequence[Floats],
    cornered: Sequence[Floats],
    extensions: tuple[Extension, ...] = (),
    sine: Sine | None = None,
) -> Candidate:
    """Fit one model of the contact force, and compute its stiffness at half of the force range.

    The model is f = baseline + P(x) + b v + sum_j c_j z_j. The signals z_j are the relaxing parts
    of the force, which decay with the time constants tau_j
    (`teleop.evaluation.batch.local_stiffness`). `relaxing` are the z_j after smoothing, each of
    shape (n,); `cornered` are the same, but not smoothed at their sharp corners (`with_corners`).
    With `sine`, k and b are k' and k''/omega of a linear model at this frequency.
    """
    fit = rows.fit(degree, relaxing, [c for one in extensions for c in one.columns])
    theta, first = fit.theta, rows.v_column + 1
    m = len(theta)
    powers = np.arange(1, degree + 1)
    coefficients = theta[first : first + degree]
    place = first + degree + len(relaxing)
    knots, depth_damping, starts = [], slice(place, place), []
    for one in extensions:
        starts.append(place)
        if one.kind == KNOT:
            knots.append((place, one.values))
        elif one.kind == DEPTH_DAMPING:
            depth_damping = slice(place, place + len(one.columns))
        place += len(one.columns)

    # The elastic force P(x) + sum_j c_j z_j at the samples in contact, without b v and baseline.
    # Sharp corners are kept, because smoothing would make the force range too small.
    index = rows.fine
    storage = np.zeros(m)
    if sine:
        # the response of z' = (x' / size) - z / tau is j omega tau / (1 + j omega tau) / size
        storage[first] = 1.0 / rows.scale
        tau = np.array(times)
        response = tau / (1.0 + (sine.omega * tau) ** 2) / sine.size
        own = slice(first + 1, first + 1 + len(times))
        storage[own] = sine.omega**2 * tau * response
    elastic = rows.fine_powers[:, :degree] @ coefficients
    for c, z in zip(theta[first + degree :], cornered, strict=False):
        elastic = elastic + c * z[index]
    if sine:
        elastic = float(storage @ theta) * rows.scale * rows.fine_powers[:, 0]
    for at, knot in knots:
        for i, part in enumerate(knot_terms(rows.fine_powers[:, 0], *knot).force):
            elastic = elastic + theta[at + i] * part

    def slope_at(s: float) -> Floats:
        """Derivative of P(x), including a knot, to the position, for each parameter, (m,)."""
        found = np.zeros(m)
        found[first : first + degree] = powers * s ** (powers - 1) / rows.scale
        for at, knot in knots:
            slope = knot_terms(s, *knot).slope
            found[at : at + len(slope)] = np.array(slope) / rows.scale
        return found

    def effect(i: int) -> Floats:
        """Derivative of the elastic force at the sample `rows.fine[i]` to each parameter, (m,)."""
        found = np.zeros(m)
        parts = [*rows.fine_powers[i, :degree], *(z[index[i]] for z in cornered)]
        found[first : first + len(parts)] = parts
        return with_knots(found, float(rows.fine_powers[i, 0]))

    def with_knots(found: Floats, s: float) -> Floats:
        for at, knot in knots:
            parts = knot_terms(s, *knot).force
            found[at : at + len(parts)] = parts
            if knot[1] == 0.0:
                found[at + 1] = float(s > knot[0])
        return found

    # Half of the force range, and its derivative to each parameter. If the force out of contact is
    # known, the range begins there: at this measured force minus the constant of the baseline,
    # which is the parameter 0.
    constant = float(rows.basis.mean(axis=0) @ theta[: rows.v_column])
    low, high = float(elastic.min()), float(elastic.max())
    top, bottom = int(np.argmax(elastic)), int(np.argmin(elastic))
    force_effect = 0.5 * (effect(top) + effect(bottom))
    if rows.phases.free_force is not None and rows.order == 0:
        low = min(rows.phases.free_force - constant, high)
        force_effect = 0.5 * effect(top)
        force_effect[0] = -0.5
    force = 0.5 * (low + high)

    # The samples in loading near this force, and the position at which the elastic force has it.
    distance = np.abs(elastic - force)
    near = with_neighbours(rows.loading & (distance < SLOPE_BAND * (high - low)), index)
    if len(near) < 6:
        order = np.argsort(np.where(rows.loading, distance, np.inf))
        near = np.sort(order[: min(6, int(rows.loading.sum()))])
    x = rows.fine_x[near]
    position = middle_position(x, elastic[near], force)
    s = (position - rows.origin) / rows.scale

    # k is linear in the parameters, k = gradient' theta: P'(x) at the position, and the slope of
    # each relaxing part against the position. This slope depends on the path of the motion. It is
    # computed in two ways, over all passes and at the nearest sample, and the difference is one of
    # the errors of k.
    gradient = slope_at(s)
    along_path = gradient.copy()
    breaks = np.diff(index[near], prepend=index[near[0]]) > 1
    pass_of = np.cumsum(breaks, dtype=np.int_)
    nearest = near[int(np.argmin(distance[near]))]
    before, after = surroundings(rows.sharp_x, int(index[nearest]), len(near), rows.record)
    step = rows.sharp_x[after] - rows.sharp_x[before]
    for j, z in enumerate(relaxing, first + degree):
        gradient[j] = loading_slope(x, z[index[near]], pass_of)
        along_path[j] = (z[after] - z[before]) / step if step else 0.0
    k = float(gradient @ theta)
    path_error = abs(float((along_path - gradient) @ theta)) / 1.5

    # The parameters also change k through the position at which it is the slope: the position
    # moves by (change of the force level - change of the elastic force) / k, and k changes with
    # the position by P''(x).
    curvature = float(coefficients[1:] @ (powers[1:] * (powers[1:] - 1) * s ** (powers[1:] - 2)))
    for at, knot in knots:
        terms = knot_terms(s, *knot).curvature
        curvature += float(theta[at : at + len(terms)] @ np.array(terms))
    curvature /= rows.scale**2
    elastic_effect = effect(nearest)
    elastic_effect[first : first + degree] = s**powers
    elastic_effect = with_knots(elastic_effect, s)
    k_effect = gradient + curvature / (k or 1e-300) * (force_effect - elastic_effect)
    # behind a compliance, b is that of specimen and compliance in series (`rows.velocity`)
    b_effect = np.zeros(m)
    b_effect[rows.v_column] = 1.0 - rows.compliance * k
    if sine:
        k_effect = storage
        b_effect[own] = response
        k, path_error = float(k_effect @ theta), 0.0
    orders = np.arange(1, depth_damping.stop - depth_damping.start + 1)
    b_effect[depth_damping] = b_effect[rows.v_column] * s**orders

    # The ends of the force range have errors that the fit does not contain: noise and resolution of
    # the position at the highest force, and the noise of the force out of contact.
    s_top = (rows.fine_x[top] - rows.origin) / rows.scale
    top_slope = float(slope_at(s_top) @ theta)
    force_std = 0.5 * math.hypot(
        top_slope * math.hypot(rows.record.count / math.sqrt(12.0), rows.record.x_noise),
        rows.phases.free_error,
    )
    range_error = force_std * curvature / (k or 1e-300)

    slopes = rows.scaled_powers[:, :degree] * powers @ coefficients / rows.scale
    for at, knot in knots:
        for i, part in enumerate(knot_terms(rows.scaled_powers[:, 1], *knot).slope):
            slopes = slopes + theta[at + i] / rows.scale * part
    to_force = np.vstack([k_effect, b_effect]) @ fit.inverse
    k_rounding, b_rounding = rows.rounding_error(to_force, slopes)
    # a shift of the position changes the force by the slope, with that of the relaxing parts
    elastic_slope = float(slope_at(s) @ theta)
    share = k / elastic_slope if times and elastic_slope > 0.0 else 1.0
    by_transmission = to_force @ (share * slopes[:, None] * rows.shifts)
    smoothing_error = SMOOTHING_ERROR * k if times and not sine else 0.0
    k_fit_error, b_fit_error = (fit.deviation(e, rows.cycles) for e in (k_effect, b_effect))

    def value(gradient: Floats) -> Value:
        """Return the linear combination gradient' theta of the parameters, with its error."""
        return Value(float(gradient @ theta), fit.deviation(gradient, rows.cycles))

    parts = []
    knot_error, share_before_knot = 0.0, 1.0
    for one, at in zip(extensions, starts, strict=True):
        unit = np.eye(m)[at]
        if one.kind == KNOT:
            size = abs(float(theta[at])) or 1e-300
            spread = fit.deviation(np.eye(m)[at + 1], rows.cycles) / size
            at_knot = one.values[0]
            below = slope_at(at_knot)
            below[at : at + len(one.columns)] = 0.0
            above = below + unit / rows.scale
            place_of = Value(rows.origin + at_knot * rows.scale, spread * rows.scale)
            parts.append(FittedPart(KNOT, (place_of, value(below), value(above))))
            lowest = float(rows.fine_powers[:, 0].min())
            rise = float((at_knot**powers - lowest**powers) @ coefficients)
            share_before_knot = rise / max(high - low, 1e-300)
            near_knot = abs(s - at_knot) < LEVEL_95 * spread
            if near_knot and one.values[1] == 0.0:  # on which side of the knot is not known
                knot_error = 0.5 * size / rows.scale
        elif one.kind == DEPTH_DAMPING:
            damping = []
            for place_at in (-1.0, 0.0, 1.0):
                at_place = np.zeros(m)
                at_place[rows.v_column] = 1.0 - rows.compliance * float(slope_at(place_at) @ theta)
                at_place[depth_damping] = at_place[rows.v_column] * place_at**orders
                damping.append(value(at_place))
            parts.append(FittedPart(DEPTH_DAMPING, tuple(damping)))
        else:
            force_or_mass = value(unit)
            if one.kind == FRICTION:
                form_error = FRICTION_FORM_ERROR * force_or_mass.value
                std = math.hypot(force_or_mass.std, form_error)
                force_or_mass = force_or_mass._replace(std=std)
            parts.append(FittedPart(one.kind, (force_or_mass,)))
    found = Candidate(
        degree=degree,
        times=times,
        bic=0.0,
        k=k,
        k_std=math.hypot(
            k_fit_error, range_error, path_error, k_rounding, smoothing_error, knot_error
        ),
        b=float(b_effect @ theta),
        b_std=math.hypot(b_fit_error, b_rounding),
        rms=float(np.sqrt(np.mean(fit.residual**2))),
        position=position,
        force=force + constant,
        theta=theta,
        relaxing=relaxing,
        cornered=cornered,
        residual=fit.residual,
        stiffening=curvature,
        extensions=extensions,
        parts=tuple(parts),
        share_before_knot=share_before_knot,
        is_storage=sine is not None,
        by_transmission=by_transmission,
    )
    return found._replace(bic=bayesian_criterion(fit.residual, found.parameters))


def knot_force(s: Any, knot: float, width: float) -> tuple[Any, Any, Any]:
    """Return a force that begins to rise at a knot, and its first and second derivative to s."""
    if width == 0.0:
        return np.maximum(s - knot, 0.0), np.where(s > knot, 1.0, 0.0), np.zeros_like(s)
    u = (s - knot) / width
    step = expit(u)
    return width * np.logaddexp(0.0, u), step, step * (1.0 - step) / width


class KnotTerms(NamedTuple):
    """The force of a knot of slope 1, and its derivatives to position and width of the knot.

    Each of the tuples contains these terms. A sharp knot has only the force.
    """

    force: tuple[Any, ...]
    slope: tuple[Any, ...]
    """First derivatives of the terms to s."""
    curvature: tuple[Any, ...]
    """Second derivatives of the terms to s."""


def knot_terms(s: Any, knot: float, width: float) -> KnotTerms:
    """Return the terms of a knot at normalised positions s; that of its position without sign."""
    force, step, bell = knot_force(s, knot, width)
    if width == 0.0:
        return KnotTerms((force,), (step,), (bell,))
    u = (s - knot) / width
    change = bell * (1.0 - 2.0 * step) / width
    return KnotTerms(
        (force, step, force / width - u * step),
        (step, bell, -u * bell),
        (bell, change, -bell / width - u * change),
    )


def surroundings(x: Floats, at: int, most: int, record: SmoothedRecord) -> tuple[int, int]:
    """Return the indices of two samples, before and after the sample `at`, to compute a slope.

    The slope is that of any signal against the position x. For an accurate slope, the positions of
    the two samples must differ by much more than the noise. Therefore, the two samples are first
    the direct neighbours of the sample `at`. Then their distance is doubled, until their positions
    differ enough, or until a further doubling would exceed `most`.
    """
    least = LEAST_SLOPE_STEP_NOISE * record.x_noise * record.noise_gain
    half = 1
    while True:
        before, after = max(at - half, 0), min(at + half, len(x) - 1)
        if abs(x[after] - x[before]) >= least or 4 * half > most:
            return before, after
        half *= 2


def with_neighbours(mask: NDArray[np.bool_], index: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the indices of the samples that a mask selects, and of their neighbours if necessary.

    The mask selects samples near half of the force range. Each time the force passes this value,
    the selected samples form a run of successive samples. To compute a slope, a run must have at
    least `FEWEST_SLOPE_SAMPLES` samples. In fast motions, the runs are shorter. If the mean length
    of the runs is less than `FEWEST_SLOPE_SAMPLES`, the samples directly before and after each run
    are added.
    """
    chosen = np.flatnonzero(mask)
    passes = np.count_nonzero(np.diff(index[chosen]) > 1) + 1
    if len(chosen) >= FEWEST_SLOPE_SAMPLES * passes:
        return chosen
    joined = np.diff(index) == 1
    wider = mask.copy()
    wider[1:] |= mask[:-1] & joined
    wider[:-1] |= mask[1:] & joined
    return np.flatnonzero(wider)


def middle_position(x: Floats, f: Floats, force: float) -> float:
    """Return the position [m] at which the force has the value `force` [N].

    The position is modelled as a polynomial of degree 2 in the force. If the samples are too few,
    or if their force is constant, the result is their mean position.
    """
    if np.ptp(f) == 0.0 or len(x) < 4:
        return float(x.mean())
    size = float(np.max(np.abs(f - force)))
    powers = ((f - force) / size)[:, None] ** np.arange(3)
    position = np.linalg.lstsq(powers, x - x.mean(), rcond=1e-8)[0][0] + x.mean()
    return float(np.clip(position, x.min(), x.max()))


def loading_slope(x: Floats, z: Floats, pass_of: NDArray[np.int_]) -> float:
    """Return the slope of a signal z against the position x, from a least-squares fit.

    The samples are near half of the force range. Each time the force passes this value in loading
    is called a pass. The fit is z = a x + c_i, where a is the slope, and c_i is a constant that is
    different for each pass i.
    """
    x, z = (values - pass_means(values, pass_of) for values in (x, z))
    return float(x @ z / max(float(x @ x), 1e-300))


def pass_means(values: Floats, pass_of: NDArray[np.int_]) -> Floats:
    """Return for each sample the mean of the values in its pass, shape (n,).

    A pass consists of successive samples near half of the force range.
    """
    return np.asarray((np.bincount(pass_of, values) / np.bincount(pass_of))[pass_of])
