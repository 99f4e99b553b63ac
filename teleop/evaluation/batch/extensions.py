"""Search extensions of the candidate models: knot, depth-dependent damping, mass and friction.

The candidates of `teleop.evaluation.batch.local_stiffness` are extended by one of these parts:

- a knot: the term c max(s - s_k, 0), with the normalised position s, also with a smooth transition.
  It describes a soft layer on a stiff one;
- damping that depends on depth: the terms s v and s^2 v (Hunt and Crossley);
- the mass of parts between the force sensor and the specimen: the acceleration;
- friction in the specimen, which builds up over a slip (`teleop.evaluation.batch.friction`).

All of them are linear in their coefficients. The knot and the slip are searched. The search uses
approximate columns, which are computed from the smoothed position. Only the best extension of
each kind is then fitted exactly, with columns that are smoothed like the force. It is kept if the
Bayesian information criterion with the effective number of samples decreases by more than
`BETTER_BIC`. The effective number is smaller than the number of samples if the residual is
autocorrelated. Otherwise, a small systematic misfit would count as strong evidence.

References
----------
K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact",
J. Applied Mechanics 42(2), 1975; G. H. Golub, V. Pereyra, "The differentiation of
pseudo-inverses and nonlinear least squares problems whose variables separate", SIAM J. Numer. Anal.
10(2), 1973.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.arrays import Floats
from estimation.autocorrelation import effective_samples
from estimation.estimator import LEVEL_95
from teleop.evaluation.batch.candidate import (
    DEPTH_DAMPING,
    FRICTION,
    KNOT,
    MASS,
    Candidate,
    Extension,
    fit_candidate,
    knot_force,
    knot_terms,
)
from teleop.evaluation.batch.friction import friction_forces
from teleop.evaluation.batch.regression_rows import DEGREES, RegressionRows
from teleop.evaluation.batch.thresholds import (
    BETTER_BIC,
    FRICTION_EXPLAINS,
    FRICTION_SLIPS,
    KNOTS,
    LARGEST_KNOT,
    LEAST_MISFIT,
    LEAST_PART,
    LEAST_SLIP_NOISE,
    LONGEST_SLIP,
)

PARTS_OF_RECORD = 8
"""Number of parts of the record, one of which is left out in the comparison of two models."""
MOST_EXTENSIONS = 2
"""Largest number of extensions of a model."""
FARTHEST_KNOT = 0.9
"""Largest distance of a knot from the middle, as a fraction of half of the travel."""
KNOT_STEPS = 5
"""Largest number of Gauss-Newton steps in the search of a knot."""
KNOT_DEGREES = (1, 2, 3)
"""Degrees of the polynomial of a model with a knot."""
KNOT_RESIDUAL = 2.0
"""Largest residual with an approximate knot, relative to that of the best model without knot, for
which the knot is refined."""
SHARP_KNOT_RESIDUAL = 1.5
"""Largest residual with a sharp knot, relative to that of the best model without knot, for which
smooth transitions are tried."""
KNOT_WIDTHS = (0.0, 0.05, 0.1, 0.2)
"""Widths of the transition at a knot that are tried, as fractions of half of the travel."""
WIDTH_FACTORS = (1.4, 1.19, 1.09)
"""Factors by which the best of these widths is changed, in both directions, one after another."""


SLIP_FACTORS = (1.4, 1.19, 1.09, 1.04, 1.02)
"""Factors by which the best slip is changed, in both directions, one after another."""
SLIP_STEP = 1.02
"""Factor on the slip with which the derivative to it is computed."""


class Base(NamedTuple):
    """A model without the extension that is tried."""

    degree: int
    times: tuple[float, ...]
    relaxing: Sequence[Floats]
    cornered: Sequence[Floats]
    extensions: tuple[Extension, ...]


class Trial(NamedTuple):
    """A base model with an extension, whose coefficients were fitted with approximate columns."""

    bic: float
    base: Base
    kind: str
    values: tuple[float, ...]


class Extended(NamedTuple):
    """Extended candidates."""

    better: list[Candidate]
    """Those that describe the force clearly better than the candidates without extension."""
    similar: list[Candidate]
    """Those with a knot that are neither clearly better nor clearly worse. They are averaged with
    the others, because their k is a possible one, but the result does not state their layers."""


def extended(rows: RegressionRows, found: Sequence[Candidate], friction: bool = True) -> Extended:
    """Return the extended candidates that describe the force better than those already found.

    `friction` states whether they may contain friction in the specimen.
    """
    kept: list[Candidate] = []
    similar: list[Candidate] = []
    best = min(found, key=lambda one: one.bic)
    size = math.sqrt(float(np.mean(rows.fits.rest**2)))
    rounding = abs(best.k) * rows.record.count / math.sqrt(12.0)
    if best.rms < max(LEAST_MISFIT * size, rounding):
        return Extended(kept, similar)
    bases = base_models(best)
    for _ in range(MOST_EXTENSIONS):
        new: list[Candidate] = []
        screening = Screening(rows, best)
        for kind in kinds(rows, best):
            if kind == FRICTION and not friction:
                continue
            for trial in screening.best_trials(bases, kind, best):
                one = fitted(rows, trial, best.rms)
                if not (one and is_physical(one) and share_of_force(rows, one) > LEAST_PART):
                    continue
                better = gain(best, one)
                if better > BETTER_BIC and (kind != FRICTION or explains_more(rows, best, one)):
                    new.append(one)
                elif kind == KNOT and better > -BETTER_BIC:
                    similar.append(one)
        if not new:
            break
        kept += new
        best = min(new, key=lambda one: one.bic)
        bases = [
            Base(degree, best.times, best.relaxing, best.cornered, best.extensions)
            for degree in dict.fromkeys([*DEGREES[:2], best.degree])
        ]
    return Extended(kept, similar)


def base_models(best: Candidate) -> list[Base]:
    """Return the models to which an extension is added, without and with relaxing parts."""
    plain = [Base(degree, (), (), (), ()) for degree in DEGREES]
    relaxing = [
        Base(degree, best.times, best.relaxing, best.cornered, ())
        for degree in dict.fromkeys([*DEGREES[:2], best.degree])
        if best.times and not best.is_storage
    ]
    return plain + relaxing


def without_fast_parts(rows: RegressionRows, base: Base) -> Base:
    """Return a model without the relaxing parts that are faster than the motion.

    For omega tau < 1, such a part of the elastic force P(x) is to first order tau P'(x) v: damping
    that depends on depth. Beside such damping it is not identifiable. It then describes the misfit
    of the model, and changes b by as much as its own damping.
    """
    slow = [i for i, tau in enumerate(base.times) if tau > rows.time_of_motion]
    # with the decays from before the record, there are more signals than time constants
    kept = [i for i in range(len(base.relaxing)) if i % max(len(base.times), 1) in slow]
    return base._replace(
        times=tuple(base.times[i] for i in slow),
        relaxing=[base.relaxing[i] for i in kept],
        cornered=[base.cornered[i] for i in kept],
    )


def kinds(rows: RegressionRows, best: Candidate) -> Iterator[str]:
    """Return the kinds of extension that the motion can show, without those of the best model."""
    present = {one.kind for one in best.extensions}
    for kind in (KNOT, DEPTH_DAMPING, MASS, FRICTION):
        # In a sine, the acceleration is proportional to the position.
        if kind not in present and not (kind == MASS and rows.record.sinusoidal):
            yield kind


def gain(one: Candidate, other: Candidate) -> float:
    """Return the decrease of the Bayesian information criterion, from one to the other candidate.

    The number of samples is the effective one of the other candidate. The part of the record with
    the largest decrease is left out: a disturbance in one part is no property of the specimen.
    """
    powers = np.array(
        [
            [float(part @ part) for part in np.array_split(each.residual, PARTS_OF_RECORD)]
            for each in (one, other)
        ]
    )
    kept = np.arange(PARTS_OF_RECORD) != int(np.argmax(powers[0] - powers[1]))
    before, after = powers[:, kept].sum(axis=1)
    n = effective_samples(other.residual) * (1.0 - 1.0 / PARTS_OF_RECORD)
    ratio = max(before, 1e-300) / max(after, 1e-300)
    return float(n * math.log(ratio) - (other.parameters - one.parameters) * math.log(n))


def explains_more(rows: RegressionRows, one: Candidate, other: Candidate) -> bool:
    """Return whether another candidate leaves clearly less of what noise does not explain."""
    noise = rows.record.f_noise_smoothed
    before, after = (math.sqrt(max(each.rms**2 - noise**2, 0.0)) for each in (one, other))
    return after < FRICTION_EXPLAINS * before


class Screening:
    """Residuals of many models with approximate columns, from one matrix of inner products."""

    def __init__(self, rows: RegressionRows, best: Candidate) -> None:
        self.rows = rows
        self.places: dict[str, list[tuple[tuple[float, ...], NDArray[np.intp]]]] = {}
        index = rows.index
        columns = [rows.velocity[index], *rows.powers, *(z[index] for z in best.relaxing)]
        self.relaxing = {id(z): i for i, z in enumerate(best.relaxing, 1 + len(DEGREES))}
        self.extended = len(columns)
        columns += [c for one in best.extensions for c in one.columns]
        for kind in kinds(rows, best):
            self.places[kind] = []
            start = len(columns)
            choices, own = approximate_columns(rows, kind)
            columns += own
            self.places[kind] += [(values, start + np.array(at)) for values, at in choices]
        z = np.column_stack(columns)
        z = z - rows.fits.orthogonal @ (rows.fits.orthogonal.T @ z)
        self.size = np.maximum(np.linalg.norm(z, axis=0), 1e-300)
        z = z / self.size
        self.products, self.along = z.T @ z, z.T @ rows.fits.rest
        self.power = float(rows.fits.rest @ rows.fits.rest)

    def best_trials(self, bases: Sequence[Base], kind: str, best: Candidate) -> list[Trial]:
        """Return the base models with one kind of extension that are promising.

        There is at most one, or for a knot one of each degree in `KNOT_DEGREES`.
        """
        n = len(self.rows.f)
        trials = []
        for base in bases:
            if kind == FRICTION and base.times:  # together they imitate lost motion
                continue
            if kind == DEPTH_DAMPING:
                base = without_fast_parts(self.rows, base)
            own = len([c for one in base.extensions for c in one.columns])
            used = [*range(base.degree + 1), *(self.relaxing[id(z)] for z in base.relaxing)]
            used += range(self.extended, self.extended + own)
            found = []
            for values, at in self.places[kind]:
                if not self.rows.allow(base.degree + len(base.times) + own + len(at)):
                    continue
                chosen = np.array([*used, *at])
                m = len(chosen) + len(base.times) + searched(kind) * len(values)
                power, theta = self.solution(chosen)
                if not right_signs(kind, theta[len(used) :]):
                    continue
                bic = n * math.log(max(power / n, 1e-300)) + m * math.log(n)
                found.append(Trial(bic, base, kind, values))
            if found:
                trials.append(min(found, key=lambda one: one.bic))
        trials.sort(key=lambda one: one.bic)
        known = best.bic - self.rows.v_column * math.log(n)  # without those of the baseline
        if kind != KNOT:
            return [one for one in trials[:1] if one.bic < known]
        # The position of the knot is approximate, and a polynomial of high degree imitates a knot.
        allowed = 2.0 * n * math.log(KNOT_RESIDUAL) if best.degree > 2 or best.times else 0.0
        lowest = {one.base.degree: one for one in reversed(trials)}
        promising = [lowest[degree] for degree in KNOT_DEGREES if degree in lowest]
        return [one for one in promising if one.bic < known + allowed]

    def solution(self, chosen: NDArray[np.intp]) -> tuple[float, Floats]:
        """Return the sum of squares of the residual with the chosen columns, and coefficients."""
        g = self.along[chosen]
        theta = np.linalg.lstsq(self.products[chosen[:, None], chosen], g, rcond=1e-12)[0]
        return self.power - float(g @ theta), theta / self.size[chosen]


def right_signs(kind: str, theta: Floats) -> bool:
    """Return whether the coefficients of an extension have the sign that their cause requires.

    Mass and friction are positive, and the damping grows with depth. Lost motion between the
    position sensor and the tip, and a lag of the force, give friction and damping of the opposite
    sign.
    """
    if kind == DEPTH_DAMPING:
        return bool(theta[0] > (abs(theta[1]) if len(theta) > 1 else 0.0))
    return kind == KNOT or bool(np.all(theta > 0.0))


def searched(kind: str) -> bool:
    """Return whether the values of a kind of extension are searched, and count as parameters."""
    return kind in (KNOT, FRICTION)


Choices = list[tuple[tuple[float, ...], list[int]]]
"""Values of an extension that are tried, with the indices of their columns."""


def approximate_columns(rows: RegressionRows, kind: str) -> tuple[Choices, list[Floats]]:
    """Return the values to be tried of an extension, with columns from smoothed signals."""
    record, index = rows.record, rows.index
    s, v = rows.normalised(record.x[index]), rows.velocity[index]
    if kind == KNOT:
        knots = np.linspace(-LARGEST_KNOT, LARGEST_KNOT, KNOTS).tolist()
        return [((knot,), [i]) for i, knot in enumerate(knots)], [
            np.maximum(s - knot, 0.0) for knot in knots
        ]
    if kind == DEPTH_DAMPING:
        return [((1.0,), [0]), ((2.0,), [0, 1])], [s * v, s**2 * v]
    if kind == MASS:
        return [((), [0])], [record.derivative(record.v)[index]]
    slips = friction_slips(rows)
    forces = friction_forces(record, np.array(slips))
    return [((slip,), [i]) for i, slip in enumerate(slips)], list(forces[:, index])


def friction_slips(rows: RegressionRows) -> list[float]:
    """Return the slips of the friction that are tried [m]."""
    record = rows.record
    least = LEAST_SLIP_NOISE * max(record.x_noise * record.noise_gain, record.count)
    slips = [max(share * rows.scale, least) for share in FRICTION_SLIPS]
    return [slip for slip in dict.fromkeys(slips) if slip < LONGEST_SLIP * rows.scale]


def fitted(rows: RegressionRows, trial: Trial, rms: float) -> Candidate | None:
    """Return the candidate with the extension of a trial; None if a knot is not promising.

    `rms` is the residual of the best model without the extension.
    """
    base, values = trial.base, trial.values
    if trial.kind == KNOT:
        sharp, _ = refined_knot(rows, base, values[0], 0.0)
        if sharp > len(rows.f) * (SHARP_KNOT_RESIDUAL * rms) ** 2:
            return None
        found = [refined_knot(rows, base, values[0], width) for width in KNOT_WIDTHS]
        least, values = min(found)
        for factor in WIDTH_FACTORS if values[1] else ():
            found += [
                refined_knot(rows, base, values[0], values[1] * each)
                for each in (factor, 1.0 / factor)
            ]
            least, values = min(found)
        if not math.isfinite(least):
            return None
    if trial.kind == FRICTION:
        values = (refined_slip(rows, base, values[0]),)
    columns = exact_columns(rows, trial.kind, values)
    if trial.kind == KNOT and values[1]:  # the width is a parameter too, as the position is
        width = knot_terms(rows.depth, *values).force[2]
        columns = (*columns, rows.record.smoothed(width)[rows.index])
    extension = Extension(trial.kind, values, columns)
    return fit_candidate(
        rows,
        base.degree,
        base.times,
        base.relaxing,
        base.cornered,
        (*base.extensions, extension),
    )


def share_of_force(rows: RegressionRows, one: Candidate) -> float:
    """Return the force of the last extension, divided by the force: root mean squares."""
    columns = np.column_stack(one.extensions[-1].columns)
    force = columns @ one.theta[len(one.theta) - columns.shape[1] :]
    return float(np.std(force) / max(math.sqrt(float(np.mean(rows.fits.rest**2))), 1e-300))


def refined_knot(
    rows: RegressionRows, base: Base, knot: float, width: float
) -> tuple[float, tuple[float, float]]:
    """Return the least sum of squares with a knot, and position and width of this knot.

    The position is searched by Gauss-Newton steps from a first value. The sum of squares is that
    without a jump of the force at the knot: with a jump, a wrong position can fit better.
    """
    further = [c for one in base.extensions for c in one.columns]
    least, found = math.inf, knot
    step = 2.0 * LARGEST_KNOT / (KNOTS - 1)
    for _ in range(KNOT_STEPS):
        columns = exact_columns(rows, KNOT, (knot, width))
        fit = rows.fit(base.degree, base.relaxing, [*further, *columns])
        slope, jump = fit.theta[-2:]
        to_jump = np.eye(len(fit.theta))[-1] @ fit.inverse
        by_jump = float(jump**2 / max(float(to_jump @ to_jump), 1e-300))
        own = float(np.sum(fit.residual**2)) + by_jump
        if own < least:
            least, found = own, knot
        change = float(np.clip(-jump / (slope or 1e-300), -step, step))
        knot += change
        if abs(knot) > FARTHEST_KNOT:
            return math.inf, (found, width)
        if abs(change) < 1e-3:
            break
    return least, (found, width)


def refined_slip(rows: RegressionRows, base: Base, slip: float) -> float:
    """Return the slip with the least sum of squares, near a first value [m]."""
    further = [c for one in base.extensions for c in one.columns]

    def squares(tried: float) -> float:
        columns = exact_columns(rows, FRICTION, (tried,))[:1]
        return float(
            np.sum(rows.fit(base.degree, base.relaxing, [*further, *columns]).residual ** 2)
        )

    least, longest = squares(slip), LONGEST_SLIP * rows.scale
    for factor in SLIP_FACTORS:
        for tried in (min(slip * factor, longest), slip / factor):
            if (own := squares(tried)) < least:
                least, slip = own, tried
    return slip


def exact_columns(rows: RegressionRows, kind: str, values: tuple[float, ...]) -> tuple[Floats, ...]:
    """Return the columns of an extension at the fitted samples, smoothed like the force.

    A knot and friction have two columns. The second one is the derivative to the knot, or to the
    slip, except for its factor. Its coefficient is nearly zero at the best knot or slip. With it,
    the errors of k and b contain that of the knot or slip.
    """
    record, index, s = rows.record, rows.index, rows.depth
    if kind == KNOT:
        return tuple(record.smoothed(one)[index] for one in knot_force(s, *values)[:2])
    if kind == DEPTH_DAMPING:
        # s^p v is the derivative of s^(p + 1) / (p + 1), except for the factor `scale`.
        smooth_s, stretched = rows.normalised(record.x), rows.velocity - record.v
        columns = []
        for p in range(1, round(values[0]) + 1):
            smoothed = record.smoothed(s ** (p + 1)) / (p + 1)
            force = rows.scale * record.derivative(smoothed) + smooth_s**p * stretched
            columns.append(force[index])
        return tuple(columns)
    if kind == MASS:
        return (record.derivative(record.v)[index],)
    (slip,) = values
    slips = slip * np.array([1.0, SLIP_STEP, 1.0 / SLIP_STEP])
    z, above, below = (record.smoothed(z)[index] for z in friction_forces(record, slips))
    return z, above - below


def is_physical(one: Candidate) -> bool:
    """Return whether the extensions of a fitted model can be those of a passive specimen.

    The elastic force rises with depth. Stiffness before and after a knot, mass and friction are
    positive, and the damping grows with depth, and is positive at the highest position. With mass
    or friction, the damping is not negative: a lag of the force or lost motion can otherwise look
    like mass or friction. Neither is it with relaxation and damping that depends on depth, which
    together can describe almost any loss.
    """
    negative = one.b < -LEVEL_95 * one.b_std
    if not one.part(KNOT) and one.powers[::2].sum() <= 0.0:
        return False
    for part in one.parts:
        values = [each.value for each in part.values]
        if part.kind == DEPTH_DAMPING and not values[0] < values[1] < values[2] > 0.0:
            return False
        if part.kind == DEPTH_DAMPING and one.times and negative:
            return False
        if part.kind == KNOT and min(values[1:]) <= 0.0:
            return False
        if part.kind in (MASS, FRICTION) and (negative or min(values) <= 0.0):
            return False
    return True
