"""Estimate stiffness and damping from pairs of slave position and contact force.

The pairs are processed one by one in the control loop, or all at once after a trial. No command to
the drives depends on these estimates.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import NamedTuple

import numpy as np

from estimation import Bank, Conditioner, Estimate, ExpectedIntervals, Misfit
from estimation.arrays import Floats
from estimation.estimate_columns import estimate_arrays, estimate_row
from teleop.control.alignment import Pair

NO_ESTIMATE = Estimate(math.nan, math.nan, math.nan, math.nan, held=False)


class Estimated(NamedTuple):
    """Inputs and results of the estimators for one pair of slave position and contact force."""

    x: float
    """Displacement passed to the estimators [m]."""
    v: float
    """Velocity passed to the estimators [m/s]."""
    f: float
    """Force passed to the estimators [N]."""
    k_bound: float
    """Half width of the 95 % interval of k that motion and noise permit, as a fraction of k; NaN
    until it is known."""
    b_bound: float
    """The same of b."""
    contact: float
    """1 if the contact gate detects contact, else 0;
    NaN if the estimators have no contact gate."""
    estimates: tuple[float, ...]
    """Three groups of numbers in this order: the model's regressors other than v and x; the
    estimates (`estimate_row`); and the misfit of each estimator, which is NaN until it is known.
    The misfit is the systematic part of the force error."""


class EstimatedSeries(NamedTuple):
    """Inputs and results of the estimators for n pairs of slave position and contact force.

    The fields have the meaning of the fields of `Estimated`. Each array has the shape (n,).
    """

    x: Floats
    v: Floats
    f: Floats
    k_bound: Floats
    b_bound: Floats
    contact: Floats
    estimates: tuple[Floats, ...]


class Estimation:
    """Updates the estimators with the pairs of slave position and contact force of a trial.

    Two more quantities are computed: the 95 % intervals of k and b that motion and noise permit,
    and the misfit of each estimator (the systematic part of its force error).

    Parameters
    ----------
    conditioner
        Filters slave position and contact force, and computes displacement and velocity.
    bank
        The estimators.

    Attributes
    ----------
    unknown
        Result for a tick at which the estimators are not updated. All its numbers are NaN.
    """

    def __init__(self, conditioner: Conditioner, bank: Bank) -> None:
        self._conditioner = conditioner
        self._bank = bank
        self._expected = ExpectedIntervals()
        self._misfit = Misfit(bank)
        nan = math.nan
        further = max(len(e.model.further) for e in bank.values())
        estimates = {
            name: NO_ESTIMATE._replace(further=(nan,) * (2 * len(e.names) - 4))
            for name, e in bank.items()
        }
        row = ((nan,) * further, estimate_row(estimates), (nan,) * len(bank))
        self.unknown = Estimated(nan, nan, nan, nan, nan, nan, tuple(chain(*row)))

    def update(self, pair: Pair) -> Estimated:
        """Process one pair of slave position and contact force, and return the results."""
        bank, dt = self._bank, pair.dt
        x, v, f, further = self._conditioner.update(*pair)
        estimates = bank.update(x, v, f, dt, further)
        is_open, contact, gate = True, math.nan, bank.gate
        if gate:
            contact, is_open = float(gate.contact), gate.is_open
        expected = self._expected.update(x, v, f, dt, is_open)
        misfit = self._misfit.update(x, v, f, dt, further, estimates, is_open)
        row = (*further, *estimate_row(estimates), *misfit)
        return Estimated(x, v, f, *expected, contact, row)

    def run(self, position: Floats, force: Floats, dt: Floats) -> EstimatedSeries:
        """Process n pairs of slave position and contact force, and return all results.

        The results are the same as those of n calls of `update`.

        All arrays have the shape (n,).
        """
        bank = self._bank
        regression = self._conditioner.run(position, force, dt)
        x, v, f, dt, further = regression
        estimates = bank.run(*regression)
        expected = self._expected.run(x, v, f, dt, bank.opened)
        gate = bank.gate
        contact = gate.contacts.astype(np.float64) if gate else np.full(len(x), np.nan)
        misfit = self._misfit.run(regression, estimates, bank.opened)
        columns = (*further.T, *estimate_arrays(estimates), *misfit.values())
        return EstimatedSeries(x, v, f, *expected, contact, columns)
