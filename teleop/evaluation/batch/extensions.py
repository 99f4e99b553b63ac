"""Search extensions of the candidate models: knot, depth-dependent damping, mass and friction.

The candidates of `teleop.evaluation.batch.local_stiffness` are extended by one of these parts:

- a knot: the term c max(s - s_k, 0), with the normalised position s. It describes a soft layer on a
  stiff one;
- damping that depends on depth: the terms s v and s^2 v (Hunt and Crossley);
- the mass of parts between the force sensor and the specimen: the acceleration;
- friction in the specimen: the stop operator x - play_r(x) with the half width r.

All of them are linear in their coefficients. The knot and the half width r are searched. The search
uses approximate columns, which are computed from the smoothed position. Only the best extension of
each kind is then fitted exactly, with columns that are smoothed like the force. It is kept if the
Bayesian information criterion with the effective number of samples decreases by more than
`BETTER_BIC`. The effective number is smaller than the number of samples if the residual is
autocorrelated. Otherwise, a small systematic misfit would count as strong evidence.

References
----------
K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact",
J. Applied Mechanics 42(2), 1975; M. Brokate, J. Sprekels, "Hysteresis and Phase Transitions",
Springer, 1996 (play and stop operators); G. H. Golub, V. Pereyra, "The differentiation of
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
from estimation.filters import Play
from teleop.evaluation.batch.candidate import (
    DEPTH_DAMPING,
    FRICTION,
    KNOT,
    MASS,
    Candidate,
    Extension,
    fit_candidate,
)
from teleop.evaluation.batch.regression_rows import DEGREES, RegressionRows
from teleop.evaluation.batch.thresholds import (
    BETTER_BIC,
    FRICTION_WIDTHS,
    KNOTS,
    LARGEST_KNOT,
    LEAST_MISFIT,
    LEAST_STOP_NOISE,
)

MOST_EXTENSIONS = 2
"""Largest number of extensions of a model."""
KNOT_STEPS = 5
"""Largest number of Gauss-Newton steps in the search of a knot."""


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
    value: float


def extended(rows: RegressionRows, found: Sequence[Candidate]) -> list[Candidate]:
    """Return the extended candidates that describe the force better than those already found."""
    kept: list[Candidate] = []
    best = min(found, key=lambda one: one.bic)
    size = math.sqrt(float(np.mean(rows.fits.rest**2)))
    if best.rms < LEAST_MISFIT * size:
        return kept
    bases = base_models(best)
    for _ in range(MOST_EXTENSIONS):
        new: list[Candidate] = []
        screening = Screening(rows, best)
        for kind in kinds(rows, best):
            if trial := screening.best_trial(bases, kind, best):
                one = fitted(rows, trial)
                if one and is_physical(one) and gain(best, one) > BETTER_BIC:
                    new.append(one)
        if not new:
            break
        kept += new
        best = min(new, key=lambda one: one.bic)
        bases = [
            Base(degree, best.times, best.relaxing, best.cornered, best.extensions)
            for degree in dict.fromkeys([*DEGREES[:2], best.degree])
        ]
    return kept


def base_models(best: Candidate) -> list[Base]:
    """Return the models to which an extension is added, without and with relaxing parts."""
    plain = [Base(degree, (), (), (), ()) for degree in DEGREES]
    relaxing = [
        Base(degree, best.times, best.relaxing, best.cornered, ())
        for degree in dict.fromkeys([*DEGREES[:2], best.degree])
        if best.times
    ]
    return plain + relaxing


def kinds(rows: RegressionRows, best: Candidate) -> Iterator[str]:
    """Return the kinds of extension that the motion can show, without those of the best model."""
    present = {one.kind for one in best.extensions}
    for kind in (KNOT, DEPTH_DAMPING, MASS, FRICTION):
        # In a sine, the acceleration is proportional to the position.
        if kind not in present and not (kind == MASS and rows.record.sinusoidal):
            yield kind


def effective_samples(residual: Floats) -> float:
    """Return the number of independent samples with the information of n correlated samples."""
    n = len(residual)
    power = float(residual @ residual)
    rho = float(residual[1:] @ residual[:-1]) / max(power, 1e-300)
    rho = min(max(rho, 0.0), 0.99)
    return max(n * (1.0 - rho) / (1.0 + rho), 2.0)


def gain(one: Candidate, other: Candidate) -> float:
    """Return the decrease of the Bayesian information criterion, from one to the other candidate.

    The number of samples is the effective one of the other candidate.
    """
    n = effective_samples(other.residual)
    return 2.0 * n * math.log(one.rms / max(other.rms, 1e-300)) - (
        other.parameters - one.parameters
    ) * math.log(n)


class Screening:
    """Residuals of many models with approximate columns, from one matrix of inner products."""

    def __init__(self, rows: RegressionRows, best: Candidate) -> None:
        self.rows = rows
        self.places: dict[str, list[tuple[float, NDArray[np.intp]]]] = {}
        index = rows.index
        columns = [rows.record.v[index], *rows.powers, *(z[index] for z in best.relaxing)]
        self.extended = len(columns)
        columns += [c for one in best.extensions for c in one.columns]
        for kind in kinds(rows, best):
            self.places[kind] = []
            for value, own in approximate_columns(rows, kind):
                at = np.arange(len(columns), len(columns) + len(own))
                self.places[kind].append((value, at))
                columns += own
        z = np.column_stack(columns)
        z = z - rows.fits.orthogonal @ (rows.fits.orthogonal.T @ z)
        self.size = np.maximum(np.linalg.norm(z, axis=0), 1e-300)
        z = z / self.size
        self.products, self.along = z.T @ z, z.T @ rows.fits.rest
        self.power = float(rows.fits.rest @ rows.fits.rest)

    def best_trial(self, bases: Sequence[Base], kind: str, best: Candidate) -> Trial | None:
        """Return the best base model with one kind of extension, if it is better than `best`."""
        n = len(self.rows.f)
        trials = []
        for base in bases:
            own = len([c for one in base.extensions for c in one.columns])
            used = [*range(base.degree + 1), *range(6, 6 + len(base.relaxing))]
            used += range(self.extended, self.extended + own)
            for value, at in self.places[kind]:
                if not self.rows.allow(base.degree + len(base.times) + own + len(at)):
                    continue
                chosen = np.array([*used, *at])
                m = len(chosen) + len(base.times) + (kind in (KNOT, FRICTION))
                power = self.remaining(chosen)
                bic = n * math.log(max(power / n, 1e-300)) + m * math.log(n)
                trials.append(Trial(bic, base, kind, value))
        if not trials:
            return None
        found = min(trials, key=lambda one: one.bic)
        known = best.bic - self.rows.v_column * math.log(n)  # without those of the baseline
        return found if found.bic < known else None

    def remaining(self, chosen: NDArray[np.intp]) -> float:
        """Return the sum of squares of the residual of a fit with the chosen columns."""
        g = self.along[chosen]
        theta = np.linalg.lstsq(self.products[np.ix_(chosen, chosen)], g, rcond=1e-12)[0]
        return self.power - float(g @ theta)


def approximate_columns(rows: RegressionRows, kind: str) -> list[tuple[float, list[Floats]]]:
    """Return the values to be tried of an extension, with its columns from smoothed signals."""
    record, index = rows.record, rows.index
    s, v = rows.normalised(record.x[index]), record.v[index]
    if kind == KNOT:
        knots = np.linspace(-LARGEST_KNOT, LARGEST_KNOT, KNOTS).tolist()
        return [(knot, [np.maximum(s - knot, 0.0)]) for knot in knots]
    if kind == DEPTH_DAMPING:
        return [(1.0, [s * v]), (2.0, [s * v, s**2 * v])]
    if kind == MASS:
        return [(0.0, [acceleration(rows)[index]])]
    every = max(1, record.stride // 4)
    position, nearest = record.x[::every], index // every
    return [
        (width, [(position - Play(width).run(position))[nearest]]) for width in stop_widths(rows)
    ]


def stop_widths(rows: RegressionRows) -> list[float]:
    """Return the half widths of the stop operator that are tried [m]."""
    record = rows.record
    least = LEAST_STOP_NOISE * max(record.x_noise, record.count)
    widths = [max(share * rows.scale, least) for share in FRICTION_WIDTHS]
    return [width for width in dict.fromkeys(widths) if width < rows.scale]


def fitted(rows: RegressionRows, trial: Trial) -> Candidate | None:
    """Return the candidate with the extension of a trial; None if a knot leaves its range."""
    base, value = trial.base, trial.value
    if trial.kind == KNOT:
        found = refined_knot(rows, base, value)
        if found is None:
            return None
        value = found
    extension = Extension(trial.kind, value, exact_columns(rows, trial.kind, value))
    return fit_candidate(
        rows,
        base.degree,
        base.times,
        base.relaxing,
        base.cornered,
        (*base.extensions, extension),
    )


def refined_knot(rows: RegressionRows, base: Base, knot: float) -> float | None:
    """Return the knot with the least residual, by Gauss-Newton steps from a first value."""
    further = [c for one in base.extensions for c in one.columns]
    least, found = math.inf, knot
    step = 2.0 * LARGEST_KNOT / (KNOTS - 1)
    for _ in range(KNOT_STEPS):
        columns = exact_columns(rows, KNOT, knot)
        fit = rows.fit(base.degree, base.relaxing, [*further, *columns])
        own = float(np.sum(fit.residual**2))
        slope, jump = fit.theta[-2:]
        if own < least:
            least, found = own, knot
        change = float(np.clip(-jump / (slope or 1e-300), -step, step))
        knot += change
        if abs(knot) > 0.95:
            return None
        if abs(change) < 1e-4:
            break
    return found


def exact_columns(rows: RegressionRows, kind: str, value: float) -> tuple[Floats, ...]:
    """Return the columns of an extension at the fitted samples, smoothed like the force.

    A knot has two columns. The second one is the derivative to the knot, except for its factor. Its
    coefficient is zero at the best knot. With it, the errors of k contain that of the knot.
    """
    record, index, s = rows.record, rows.index, rows.depth
    if kind == KNOT:
        above = np.maximum(s - value, 0.0)
        return tuple(record.smoothed(one)[index] for one in (above, np.where(above > 0.0, 1.0, 0.0)))
    if kind == DEPTH_DAMPING:
        # s^p v is the derivative of s^(p + 1) / (p + 1), except for the factor `scale`.
        powers = range(1, round(value) + 1)
        smoothed = (record.smoothed(s ** (p + 1)) / (p + 1) for p in powers)
        return tuple(rows.scale * derivative(rows, one)[index] for one in smoothed)
    if kind == MASS:
        return (acceleration(rows)[index],)
    pieces = np.split(record.raw_x, record.starts[1:])
    stop = np.concatenate([piece - Play(value).run(piece) for piece in pieces])
    return (record.smoothed(stop)[index],)


def acceleration(rows: RegressionRows) -> Floats:
    """Return the acceleration of the smoothed position [m/s^2]."""
    return derivative(rows, rows.record.v)


def derivative(rows: RegressionRows, values: Floats) -> Floats:
    """Return the time derivative of a smoothed signal, separately in each piece between gaps."""
    record = rows.record
    pieces = np.split(values, record.starts[1:])
    return np.concatenate([np.gradient(piece, record.period) for piece in pieces])


def is_physical(one: Candidate) -> bool:
    """Return whether the coefficients of the extensions have the sign that their cause requires.

    Stiffness before and after a knot, mass and friction are positive, and the damping grows with
    depth. Lost motion between the position sensor and the tip, and a lag of the force, give
    friction and damping of the opposite sign.
    """
    for found in one.parts:
        values = [part.value for part in found.values]
        if found.kind == KNOT and min(values[1:]) <= 0.0:
            return False
        if found.kind == DEPTH_DAMPING and not (values[1] > values[0] and values[1] > 0.0):
            return False
        if found.kind in (MASS, FRICTION) and values[0] <= 0.0:
            return False
    return True
