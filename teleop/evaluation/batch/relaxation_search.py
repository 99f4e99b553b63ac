"""Fit models of the contact force with relaxing parts, and search their time constants.

The models are those of `teleop.evaluation.batch.local_stiffness`. A relaxing part is the signal z
with z' = dy/dt - z / tau, where y is the position or the elastic force, and tau is a time constant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.batch_models.relaxation import relaxing_part, value_at_start
from estimation.robust_error import bayesian_criterion
from teleop.evaluation.batch.candidate import Candidate, fit_candidate
from teleop.evaluation.batch.regression_rows import RegressionRows, with_corners
from teleop.evaluation.batch.smoothed_record import measurement_noise
from teleop.evaluation.batch.thresholds import NEGLIGIBLE_BIC

TIMES = 10
"""Number of relaxation time constants that are tried. They are between 4 widths of the smoothing
kernel and `RegressionRows.longest_time`."""
REFINEMENTS = 3
"""Number of times that the step of log tau is halved in the search around the best time
constant."""


class TriedTimes(NamedTuple):
    """A model of the force that was fitted with certain time constants."""

    times: tuple[float, ...]
    """Time constants of its relaxing parts [s]."""
    bic: float
    """Bayesian information criterion of the fit."""
    is_passive: bool
    """Whether the coefficients of all relaxing parts are zero or positive.

    This is so for every passive body (generalised Maxwell body). Two relaxing parts with
    coefficients of opposite signs can describe almost any change of the force. If the baseline of
    the model also contains cosines, such a model does not determine the stiffness.
    """


class RelaxingParts:
    """The relaxing parts of a signal, each computed once for a time constant."""

    def __init__(self, rows: RegressionRows, y: Floats) -> None:
        self._record = record = rows.record
        y = rows.in_contact(y)
        y = (y - y[0]) / max(float(np.std(y)), 1e-300)
        self._pieces = [piece - value_at_start(piece) for piece in np.split(y, record.starts[1:])]
        self._noise = measurement_noise(y)
        scale = float(np.std(y)) / max(float(np.std(record.raw_x)), 1e-300)
        self._largest_corner = rows.largest_corner * scale
        self._parts: dict[float, tuple[Floats, Floats]] = {}

    def signals(self, times: tuple[float, ...]) -> tuple[list[Floats], list[Floats]]:
        """Return the relaxing parts with these time constants [s], in two forms.

        The first list contains the smoothed signals. The second list contains the same signals, but
        with the values before the smoothing at sharp corners (see `with_corners`).
        """
        parts = [self._part(tau) for tau in times]
        return [smoothed for smoothed, _ in parts], [cornered for _, cornered in parts]

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
    """Return fitted models of the force that contain one or two relaxing parts.

    Several time constants are tried. The models also contain a slow part of the force, the
    baseline. If the baseline contains cosines, only passive models are returned. A model whose
    Bayesian information criterion exceeds the least one by more than `NEGLIGIBLE_BIC` is left out.
    """
    parts = RelaxingParts(rows, y)
    found = []
    for degree in degrees:
        chosen: tuple[float, ...] = ()
        for _ in range(2):
            if not rows.allow(degree + len(chosen) + 1):
                break
            trials = search(rows, parts, degree, chosen)
            chosen = min(trials, key=lambda one: one.bic).times
            suitable = [one for one in trials if rows.order == 0 or one.is_passive]
            least_bic = min([least_bic, *(one.bic for one in suitable)])
            found += [
                fit_candidate(rows, degree, one.times, *parts.signals(one.times))
                for one in suitable
                if one.bic <= least_bic + NEGLIGIBLE_BIC
            ]
    return found


def search(
    rows: RegressionRows, parts: RelaxingParts, degree: int, chosen: tuple[float, ...]
) -> list[TriedTimes]:
    """Search the time constant of a further relaxing part; return all models that were fitted."""

    def tried(tau: float) -> TriedTimes:
        times = (*chosen, tau)
        relaxing, _ = parts.signals(times)
        fit = rows.fit(degree, relaxing)
        bic = bayesian_criterion(fit.residual, len(fit.theta) + len(times))
        return TriedTimes(times, bic, bool(np.all(fit.theta[-len(times) :] >= 0.0)))

    times = np.geomspace(4.0 * rows.record.width, rows.longest_time, TIMES).tolist()
    trials = [tried(tau) for tau in times if tau not in chosen]
    step = math.sqrt(times[1] / times[0])
    for _ in range(REFINEMENTS):
        best = min(trials, key=lambda one: one.bic).times[-1]
        step = math.sqrt(step)
        trials += [tried(best * step), tried(best / step)]
    return trials
