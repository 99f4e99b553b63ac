"""Fit models of the contact force with relaxing parts, and search their time constants.

The models are those of `teleop.evaluation.batch.local_stiffness`. A relaxing part is the signal z
with z' = dy/dt - z / tau, where y is the position or the elastic force, and tau is a time constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.batch_models.relaxation import relaxing_part, value_at_start
from teleop.evaluation.batch.candidate import Candidate, Sine, fit_candidate
from teleop.evaluation.batch.regression_rows import RegressionRows, with_corners
from teleop.evaluation.batch.smoothed_record import measurement_noise
from teleop.evaluation.batch.thresholds import LEAST_PART, NEGLIGIBLE_BIC, SAME_TIME_RATIO

TIMES = 10
"""Number of time constants on the grid. They are between 4 widths of the smoothing kernel and
`RegressionRows.longest_time`."""
MOST_PARTS = 3
"""Largest number of relaxing parts of a model. A spectrum that is continuous, such as that of a
springpot or of a poroelastic body, needs more than two in a range of frequencies."""
REFINEMENTS = 5
"""Number of times that the step of log tau is halved in the search around the best time
constants of the grid."""
NEVER_SINGULAR = 1e-13
"""Increase of the diagonal of the normal equations, whose columns have the norm 1."""
MOST_MODELS = 3
"""Largest number of models of the same degree and number of relaxing parts that are returned."""


class TriedTimes(NamedTuple):
    """A model of the force that was fitted with certain time constants."""

    bic: float
    """Bayesian information criterion of the fit."""
    times: tuple[float, ...]
    """Time constants of its relaxing parts [s]."""
    is_passive: bool
    """Whether the coefficients of all relaxing parts are zero or positive, and P(x) rises.

    This is so for every passive body (generalised Maxwell body). Two relaxing parts with
    coefficients of opposite signs can describe almost any change of the force.
    """


class RelaxingParts:
    """The relaxing parts of a signal, each computed once for a time constant."""

    def __init__(self, rows: RegressionRows, y: Floats) -> None:
        self._record = record = rows.record
        y = rows.in_contact(y)
        self.size = max(float(np.std(y)), 1e-300)
        """Standard deviation of the signal: its relaxing parts are divided by it."""
        y = (y - y[0]) / self.size
        self._pieces = [piece - value_at_start(piece) for piece in np.split(y, record.starts[1:])]
        self._noise = measurement_noise(y)
        scale = float(np.std(y)) / max(float(np.std(record.raw_x)), 1e-300)
        self._largest_corner = rows.largest_corner * scale
        self._parts: dict[float, tuple[Floats, Floats]] = {}
        self._begun_before = rows.order == 0 and bool(rows.phases.contact[0])
        """Whether forces may relax that arose before the record; cosines would describe them."""

    def signals(self, times: tuple[float, ...]) -> tuple[list[Floats], list[Floats]]:
        """Return the relaxing parts with these time constants [s], in two forms.

        The first list contains the smoothed signals. The second list contains the same signals, but
        with the values before the smoothing at sharp corners (see `with_corners`). If the record
        begins in contact, the relaxing parts have unknown values there. Then each list also
        contains the decay of such a value, for each time constant.
        """
        parts = [self._part(tau) for tau in times]
        smoothed, cornered = [one for one, _ in parts], [one for _, one in parts]
        decays = [np.exp(-self._record.clock / tau) for tau in times if self._begun_before]
        return smoothed + decays, cornered + decays

    def _part(self, tau: float) -> tuple[Floats, Floats]:
        """Return the relaxing part with one time constant, in both forms."""
        if tau not in self._parts:
            z = relaxing_part(self._pieces, self._record.period, tau)
            smoothed = self._record.smoothed(z)
            cornered = with_corners(z, smoothed, self._noise, self._largest_corner)
            self._parts[tau] = smoothed, cornered
        return self._parts[tau]


def with_relaxation(
    rows: RegressionRows, y: Floats, degrees: tuple[int, ...], least_bic: float
) -> list[Candidate]:
    """Return fitted models of the force that contain one or more relaxing parts.

    All subsets of a grid of time constants are tried, and those near the best subset. Only passive
    models are returned. A model whose Bayesian information criterion exceeds the least one by more
    than `NEGLIGIBLE_BIC` is left out.
    """
    parts = RelaxingParts(rows, y)
    found = []
    for degree in degrees:
        fits = FitsOfTimes(rows, parts, degree)
        for count in range(1, MOST_PARTS + 1):
            if not rows.allow(degree + count):
                break
            suitable = [one for one in search(rows, fits, count) if one.is_passive]
            least_bic = min([least_bic, *(one.bic for one in suitable)])
            fitted = (
                fit_candidate(rows, degree, one.times, *parts.signals(one.times))
                for one in sorted(suitable)[:MOST_MODELS]
                if one.bic <= least_bic + NEGLIGIBLE_BIC
            )
            found += [one for one in fitted if fast_parts_count(rows, one)]
    return found


def fast_parts_count(rows: RegressionRows, one: Candidate) -> bool:
    """Return whether all relaxing parts that are faster than the motion are large enough.

    For omega tau < 1, a relaxing part is to first order a damping force. A small one is rather an
    error of the model, such as the lag of a damping force behind a compliance. It would take its
    damping from b.
    """
    fast = np.array(one.times) < rows.time_of_motion
    least = LEAST_PART * math.sqrt(float(np.mean(rows.fits.rest**2)))
    return bool(np.all(one.relaxing_sizes[fast] > least))


def linear_with_relaxation(rows: RegressionRows, omega: float) -> list[Candidate]:
    """Return linear models with relaxing parts, whose k and b are k' and k''/omega in a sine.

    In an exact sine they are those of the Kelvin-Voigt model, and the relaxing parts change
    nothing. Behind lost motion, a sine rests at each reversal. The force then relaxes, which
    neither a damping force nor a polynomial in the position describes.
    """
    parts = RelaxingParts(rows, rows.normalised(rows.record.raw_x))
    fits, sine = FitsOfTimes(rows, parts, 1), Sine(omega, parts.size * rows.scale)
    found = []
    for count in range(1, MOST_PARTS + 1):
        if not rows.allow(1 + count):
            break
        suitable = [one for one in search(rows, fits, count) if one.is_passive]
        found += [
            fit_candidate(rows, 1, one.times, *parts.signals(one.times), sine=sine)
            for one in sorted(suitable)[:1]
        ]
    return found


def search(rows: RegressionRows, fits: FitsOfTimes, count: int) -> list[TriedTimes]:
    """Search the time constants of a number of relaxing parts; return all models that were fitted.

    The grid is searched completely, then the best time constants are changed one after another.
    """
    grid = np.geomspace(4.0 * rows.record.width, rows.longest_time, TIMES).tolist()
    trials = fits.fitted(combinations(grid, count))
    step = math.sqrt(grid[1] / grid[0])
    for _ in range(REFINEMENTS):
        step = math.sqrt(step)
        for i in range(count):
            times = min(trials).times
            changed = [
                (*times[:i], times[i] * factor, *times[i + 1 :]) for factor in (step, 1.0 / step)
            ]
            trials += fits.fitted(
                each
                for each in changed
                if all(long > SAME_TIME_RATIO * short for short, long in pairwise(each))
            )
    return trials


class FitsOfTimes:
    """Fits of the models of one degree with any time constants of their relaxing parts.

    The relaxing parts are projected onto the subspace that is orthogonal to all other regressors.
    """

    def __init__(self, rows: RegressionRows, parts: RelaxingParts, degree: int) -> None:
        self._rows, self._parts = rows, parts
        others = np.column_stack([rows.velocity[rows.index], *rows.powers[:degree]])
        self._others, triangular = np.linalg.qr(self._beyond_baseline(others))
        odd = np.arange(degree + 1) % 2 == 1  # the powers that change from s = -1 to s = 1
        rise = np.linalg.lstsq(triangular.T, odd.astype(float), rcond=None)[0]
        self._rise = self._others @ rise
        """The product with a signal is the rise of P(x) in a fit to this signal."""
        self._force = self._projected(rows.fits.rest)
        self._parameters = rows.v_column + 1 + degree
        self._columns: dict[float, list[tuple[Floats, float]]] = {}

    def fitted(self, subsets: Iterable[tuple[float, ...]]) -> list[TriedTimes]:
        """Fit the models with these time constants, of which all have the same number."""
        chosen = list(subsets)
        if not chosen:
            return []
        taus = sorted({tau for times in chosen for tau in times})
        prepared = [one for tau in taus for one in self._columns_of(tau)]
        columns = np.column_stack([column for column, _ in prepared])
        gram, along = columns.T @ columns, columns.T @ self._force
        gram.flat[:: len(gram) + 1] += NEVER_SINGULAR
        per_time = len(gram) // len(taus)  # columns for each time constant
        first = per_time * np.array([[taus.index(tau) for tau in times] for times in chosen])
        at = np.concatenate([first + i for i in range(per_time)], axis=1)
        theta = np.linalg.solve(gram[at[:, :, None], at[:, None, :]], along[at][:, :, None])[..., 0]
        n, count = len(self._force), first.shape[1]
        power = np.maximum(self._force @ self._force - np.sum(theta * along[at], axis=1), 1e-300)
        parameters = self._parameters + (per_time + 1) * count
        bics = n * np.log(power / n) + parameters * math.log(n)
        rises = np.array([rise for _, rise in prepared])
        rise = self._rise @ self._rows.fits.rest - np.sum(theta * rises[at], axis=1)
        passive = np.all(theta[:, :count] >= 0.0, axis=1) & (rise > 0.0)
        return [
            TriedTimes(*each) for each in zip(bics.tolist(), chosen, passive.tolist(), strict=True)
        ]

    def _columns_of(self, tau: float) -> list[tuple[Floats, float]]:
        """Return the projected regressors of a time constant, with the norm 1, and their rises."""
        if tau not in self._columns:
            self._columns[tau] = []
            for signal in self._parts.signals((tau,))[0]:
                z = self._beyond_baseline(signal[self._rows.index])
                column = self._projected(z)
                size = max(float(np.linalg.norm(column)), 1e-300)
                self._columns[tau].append((column / size, float(self._rise @ z) / size))
        return self._columns[tau]

    def _beyond_baseline(self, columns: Floats) -> Floats:
        q = self._rows.fits.orthogonal
        return np.asarray(columns - q @ (q.T @ columns))

    def _projected(self, column: Floats) -> Floats:
        return np.asarray(column - self._others @ (self._others.T @ column))
