"""Find a contact point that moves from press to press, and remove its motion from the position.

The surface of a specimen recedes while the specimen is preconditioned, or if the tip slides, and
the zero of a position sensor drifts. The force at a depth is then the same in all presses, but not
that at a position. A model in which the surface rests describes this by relaxation, whose stiffness
and damping are then wrong.

The model of the force in contact is

    f = f0 + (1 + g) P(x - s) + (b0 + b1 x) v + relaxing parts

P is a polynomial, and the relaxing parts have fixed time constants; there may be none. Either the
position s of the surface changes over the presses, or the stiffness changes by the factor 1 + g. s
or g is constant in each press, or linear in time between presses, or also linear in each press. If
it is given, the model is linear; it is improved by Gauss-Newton steps.

A moving contact point must describe the force much better than the best model with a surface that
rests, and better than a stiffness that changes. As for lost motion
(`teleop.evaluation.batch.lost_motion`), the number of samples in the information criterion is that
of the independent values of the residual.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.batch_models.relaxation import relaxing_part
from estimation.robust_error import robust_fit
from teleop.evaluation.batch.candidate import Candidate
from teleop.evaluation.batch.contact_phases import Phases
from teleop.evaluation.batch.lost_motion import independent_values
from teleop.evaluation.batch.masks import runs
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    FEWEST_PRESSES,
    LARGEST_MOVED_SHARE,
    LEAST_MOVED_SHARE,
    MOST_KNOTS,
    MOST_REVERSALS,
    MOVED_BIC,
    MOVED_ERRORS,
    MOVED_RESIDUAL,
    NEGLIGIBLE_MISFIT,
    NOISE_MARGIN,
    SHARE_OF_ROWS,
)
from teleop.evaluation.reading.signals import Signals

NEWTON_STEPS = 4
"""Number of steps that improve the motion of the surface, or the change of the stiffness."""
DEGREES, FEW_ROWS = (3, 5), 60
"""Smallest degree of the polynomial P(x), with up to this number of independent samples and with
more. If the presses have different positions, a polynomial of low degree does not fit them."""
TIMES = 4
"""Number of relaxing parts in the models that contain relaxation."""


class OverPresses(NamedTuple):
    """A quantity that changes over the presses."""

    times: Floats
    """Times of m knots in the presses [s], shape (m,)."""
    values: Floats
    """Values at these times, relative to their mean, shape (m,)."""
    in_steps: bool
    """Whether it changes between the presses only; otherwise it is linear between the knots."""

    def at(self, t: Floats) -> Floats:
        """Return the values at the times t [s]."""
        if self.in_steps:
            middles = 0.5 * (self.times[1:] + self.times[:-1])
            return np.asarray(self.values[np.searchsorted(middles, t)])
        return np.asarray(np.interp(t, self.times, self.values))

    @property
    def reversals(self) -> float:
        """Sum of all changes between knots, divided by the range of the values; 1 without any."""
        return float(np.abs(np.diff(self.values)).sum() / max(np.ptp(self.values), 1e-300))


class MovingContact(NamedTuple):
    """The motion of the surface of a specimen over the presses."""

    position: OverPresses
    """Position of the surface, relative to its mean [m]."""
    is_certain: bool
    """Whether the motion describes the force clearly better than a surface that rests."""

    def removed(self, signals: Signals) -> Signals:
        """Return the signals with the position relative to the surface."""
        x = signals.x - self.position.at(signals.t)
        return signals._replace(x=x, measured_step=signals.step)

    @property
    def text(self) -> str:
        """Sentence for the user that describes the motion."""
        positions = self.position.values
        change, range_ = positions[-1] - positions[0], float(np.ptp(positions))
        how = "moves"
        if abs(change) > 0.5 * range_:
            how = "recedes" if change > 0.0 else "comes nearer"
        moves = f"{how} by {range_ * 1e3:.3g} mm over the presses"
        causes = (
            "the specimen is preconditioned, or has not recovered, the tip slides, or the position "
            "drifts"
        )
        if self.is_certain:
            return (
                f"the contact point {moves}, and depths are measured from that of each press: "
                f"{causes}"
            )
        return f"the force relaxes, or the contact point {moves} ({causes})"


class PressFit(NamedTuple):
    """A model that was fitted to the force of all presses."""

    parameters: int
    """Number of fitted parameters."""
    residual: Floats
    """Residual [N], shape (n,)."""
    over_presses: OverPresses
    """Position of the surface [m], or relative change of the stiffness."""
    columns: Floats
    """Regressors, shape (n, p). The last m - 1 change the values at the knots."""

    @property
    def rms(self) -> float:
        """Root mean square of the residual [N]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    def criterion(self, n: float) -> float:
        """Bayesian information criterion for n independent values of the residual."""
        return criterion(n, self.rms, self.parameters)


def criterion(n: float, rms: float, parameters: int) -> float:
    """Return the Bayesian information criterion for n independent values of a residual [N]."""
    return 2.0 * n * math.log(max(rms, 1e-150)) + parameters * math.log(n)


def find_moving_contact(
    record: SmoothedRecord, phases: Phases, resting_best: Candidate
) -> MovingContact | None:
    """Return the motion of the contact point; None if there is no evidence for any.

    `resting_best` is the best model of the force with a surface that rests. The motion is not
    certain if that model describes the force as well with relaxation: the force of a tissue that
    relaxes falls like that of a surface that recedes.
    """
    if phases.free_force is None:
        return None
    presses = [press for press in runs(phases.contact) if phases.usable[slice(*press)].any()]
    noise = NOISE_MARGIN * record.f_noise_smoothed
    if len(presses) < FEWEST_PRESSES or (resting_best.rms < noise and not resting_best.times):
        return None
    models = PressModels(RegressionRows(record, phases), presses, resting_best.degree)

    def beyond_noise(fit: PressFit | Candidate) -> float:
        return math.sqrt(max(fit.rms**2 - noise**2, 0.0))

    found = models.fits(moves=True, relaxes=False)
    if found and min(map(beyond_noise, found)) > NEGLIGIBLE_MISFIT * noise:
        found += models.fits(moves=True, relaxes=True)
    if not found:
        return None
    n = independent_values(min(found, key=lambda one: one.rms).residual)
    best = min(found, key=lambda one: one.criterion(n))
    range_ = float(np.ptp(best.over_presses.values))
    least = max(LEAST_MOVED_SHARE * models.travel, MOVED_ERRORS * models.error(best))
    if not least < range_ < LARGEST_MOVED_SHARE * models.travel:
        return None
    left, before = beyond_noise(best), beyond_noise(resting_best)
    most = best.criterion(n) + MOVED_BIC
    if left < MOVED_RESIDUAL * before and most < criterion(
        n, resting_best.rms, resting_best.parameters
    ):
        softening = models.fits(moves=False, relaxes=False)
        softening += models.fits(moves=False, relaxes=True)
        if all(most < one.criterion(n) for one in softening):
            return MovingContact(best.over_presses, is_certain=True)
        return None
    values = best.over_presses.values
    relaxes = resting_best.times and values[-1] - values[0] > 0.5 * range_
    if relaxes and left <= NEGLIGIBLE_MISFIT * noise:
        return MovingContact(best.over_presses, is_certain=False)
    return None


class PressModels:
    """Fits the models whose surface moves, or whose stiffness changes, to the rows of a record."""

    def __init__(self, rows: RegressionRows, presses: list[tuple[int, int]], degree: int) -> None:
        self._rows, self._record = rows, rows.record
        least = DEGREES[int(len(rows.index) > FEW_ROWS)]
        self._orders = np.arange(1, max(least, degree) + 1)
        self._lowest = rows.normalised(self._record.x[rows.index]).min()
        self._taus = np.geomspace(4.0 * self._record.width, rows.longest_time, TIMES + 1)[:-1]
        self._ends = self._record.t[np.array(presses) - [0, 1]]

    @property
    def travel(self) -> float:
        """Travel in contact [m]."""
        return 2.0 * self._rows.scale

    def fits(self, moves: bool, relaxes: bool) -> list[PressFit]:
        """Fit one model for each form of the change over the presses.

        `moves` states whether the surface moves. Otherwise the stiffness changes.
        """
        middles, both = fewer(self._ends.mean(axis=1)), fewer(self._ends.ravel())
        taus = self._taus if relaxes else self._taus[:0]
        found = [
            self._improved(OverPresses(times, np.zeros(len(times)), in_steps), moves, taus)
            for times, in_steps in ((middles, True), (middles, False), (both, False))
            if len(times) < SHARE_OF_ROWS * len(self._rows.index)
        ]
        if not moves:
            return found
        # a motion in each press that is reversed after it describes the relaxation in the press
        return [
            one
            for one in found
            if len(one.over_presses.times) == len(middles)
            or one.over_presses.reversals < MOST_REVERSALS
        ]

    def error(self, fit: PressFit) -> float:
        """Return the largest standard deviation of the values at the knots."""
        size = np.maximum(np.linalg.norm(fit.columns, axis=0), 1e-300)
        apart = sum_to_zero(len(fit.over_presses.times))
        gradients = np.zeros((len(apart), len(size)))
        gradients[:, -apart.shape[1] :] = apart
        robust = robust_fit(fit.columns / size, self._rows.f)
        return max(robust.deviation(gradient / size) for gradient in gradients)

    def _improved(self, start: OverPresses, moves: bool, taus: Floats) -> PressFit:
        """Fit a model, and improve the change over the presses by Gauss-Newton steps."""
        rows, count = self._rows, len(start.times)
        t = self._record.t[rows.index]
        # a change that is the same in all presses is one of the polynomial
        apart = sum_to_zero(count)
        knots = np.column_stack([start._replace(values=one).at(t) for one in apart.T])
        found = start
        for _ in range(NEWTON_STEPS):
            others, effect, taus = self._regressors(found, moves, taus)
            columns = np.column_stack([others, effect[:, None] * knots])
            theta = np.linalg.lstsq(columns, rows.f, rcond=1e-12)[0]
            residual = rows.f - columns @ theta
            found = found._replace(values=found.values + apart @ theta[1 - count :])
        return PressFit(columns.shape[1] + len(taus), residual, found, columns)

    def _regressors(
        self, change: OverPresses, moves: bool, taus: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return the regressors without those of the change, its effect on the force, and `taus`.

        The effect is that of a fit of these regressors. The time constants whose relaxing parts
        have negative coefficients are left out.
        """
        rows, record, orders = self._rows, self._record, self._orders
        over_time = change.at(record.t)
        surface, gain = (over_time, 0.0) if moves else (np.zeros_like(over_time), over_time)
        s = rows.normalised(record.raw_x - surface)
        v = (record.v - record.derivative(record.smoothed(surface)))[rows.index]
        depth = np.clip(s - self._lowest, -0.5, 2.5)
        powers = depth[:, None] ** np.arange(len(orders) + 1)
        y = rows.in_contact(s)
        pieces = [piece - piece[0] for piece in np.split(y, record.starts[1:])]
        parts = [relaxing_part(pieces, record.period, tau) for tau in taus.tolist()]
        forces = np.column_stack([*((1.0 + gain) * powers[:, 1:].T), *parts])
        smoothed = np.column_stack([record.smoothed(one)[rows.index] for one in forces.T])
        elastic, relaxing = np.split(smoothed, [len(orders)], axis=1)
        damping = np.column_stack([v, elastic[:, 0] * v])
        others = np.column_stack([np.ones(len(v)), elastic, damping, relaxing])
        theta = np.linalg.lstsq(others, rows.f, rcond=1e-12)[0]
        passive = theta[others.shape[1] - len(taus) :] >= 0.0
        if not passive.all():
            return self._regressors(change, moves, taus[passive])
        law = theta[orders]
        force = powers[:, 1:] @ law
        slope = -(powers[:, :-1] @ (orders * law)) / rows.scale
        return others, record.smoothed(slope if moves else force)[rows.index], taus


def fewer(times: Floats) -> Floats:
    """Return means of successive times, if there are more than `MOST_KNOTS`."""
    groups = np.array_split(times, min(len(times), MOST_KNOTS))
    return np.array([one.mean() for one in groups])


def sum_to_zero(count: int) -> Floats:
    """Return orthonormal vectors whose values sum to zero, shape (count, count - 1)."""
    q, _ = np.linalg.qr(np.column_stack([np.ones(count), np.eye(count)[:, 1:]]))
    return np.asarray(q[:, 1:])
