"""Estimate stiffness and damping from the ticks of a stream.

No command to the drives depends on these estimates. Therefore the estimation is a reader of the
stream: in virtual time in the process of the loop, and in real time in another process,

    python -m teleop.streams.estimation

While this process is delayed, the estimates are late, and the loop is not.
"""

from __future__ import annotations

import base64
import pickle
import sys
import traceback
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from estimation import Bank, Conditioner, ExpectedIntervals, Misfit, Preset
from estimation.arrays import Floats
from estimation.compiled import load_compiler
from estimation.estimate_columns import estimate_arrays, estimate_row
from teleop.failures import failure
from teleop.streams.reader import Reader, Send, run_reader
from teleop.streams.stream import StreamReader

FEW = 30
"""Largest number of samples that are processed one by one. An array has a fixed cost: with all
estimators 2 ms for an array of 5 samples, and with 200 samples it takes 0.7 of the time."""
PERIOD = 2e-3
"""Time between two reads of the stream in real time [s]."""
BLOCK = 10_000
"""Largest number of ticks that are processed together."""


class Estimated(NamedTuple):
    """Inputs and results of the estimators for one pair of slave position and contact force.

    The values have the order of `teleop.streams.columns.OF_ESTIMATION`.
    """

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
    """

    def __init__(self, conditioner: Conditioner, bank: Bank) -> None:
        self._conditioner = conditioner
        self._bank = bank
        self._expected = ExpectedIntervals()
        self._misfit = Misfit(bank)

    def update(self, position: float, force: float, dt: float) -> Estimated:
        """Process one pair of slave position and contact force, and return the results."""
        bank = self._bank
        x, v, f, further = self._conditioner.update(position, force, dt)
        estimates = bank.update(x, v, f, dt, further)
        is_open, contact, gate = True, np.nan, bank.gate
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

    def rows(self, position: Floats, force: Floats, dt: Floats) -> Floats:
        """Process n pairs, and return their results, shape (n, values); see `Estimated`."""
        if len(dt) <= FEW:
            pairs = zip(position.tolist(), force.tolist(), dt.tolist(), strict=True)
            results = [self.update(*pair) for pair in pairs]
            return np.array([(*result[:6], *result.estimates) for result in results])
        series = self.run(position, force, dt)
        return np.column_stack([*series[:6], *series.estimates])


class StreamEstimation(Reader):
    """Reads the pairs of the ticks of a stream, and writes the estimates of each tick.

    A force sensor can be slower than the control loop. Then only some ticks have a pair of slave
    position and contact force. The estimates of the other ticks are NaN. The first exception of an
    estimator is sent as a message, and the estimates of all later ticks are NaN.
    """

    def __init__(self, estimation: Estimation, stream: StreamReader, send: Send) -> None:
        super().__init__(stream, send)
        self._estimation, self._estimates = estimation, stream.estimates_writer()
        self._has_failed = False
        schema = stream.schema
        names = ("paired_position", "paired_force", "paired_dt")
        self._pair = [1 + schema.loop.index(name) for name in names]
        # without a pair, an estimate is not known, and nothing is held
        self._unknown = [0.0 if name.endswith("_held") else np.nan for name in schema.estimation]

    def advance(self) -> None:
        """Process the ticks that are new since the last call, at most `BLOCK`."""
        done, ticks = self._estimates.newest, self.stream.ticks
        newest = min(ticks.newest, max(done, ticks.oldest - 1) + BLOCK)
        if newest == done:
            return
        first, new = ticks.read(done + 1, newest + 1)
        self.stream.miss(first - done - 1)
        rows = np.tile(self._unknown, (newest - done, 1))
        position, force, dt = new[:, self._pair].T
        paired = np.flatnonzero(~np.isnan(dt))
        if len(paired) and not self._has_failed:
            try:
                values = self._estimation.rows(position[paired], force[paired], dt[paired])
                rows[first - done - 1 + paired] = values
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # an estimator of another package can raise SystemExit
                self._has_failed = True
                trace = "".join(traceback.format_exception(error))
                self.send({"failure": failure(error)[0], "traceback": trace})
        self._estimates.write(rows)

    def finish(self) -> dict[str, Any]:
        """Compute the estimates of the last ticks."""
        while self._estimates.newest < self.stream.ticks.newest:
            self.advance()
        return super().finish()


def session_of(preset: Preset, conditioner: Conditioner) -> dict[str, Any]:
    """Return the session of a process of the estimation, without the stream."""
    parts = base64.b85encode(pickle.dumps((preset, conditioner))).decode()
    return {"path": sys.path, "parts": parts}


def in_process(session: Mapping[str, Any], stream: StreamReader, send: Send) -> StreamEstimation:
    """Return the estimation for a process of its own."""
    sys.path[:] = session["path"]  # so that the estimators of other packages are found
    preset, conditioner = pickle.loads(base64.b85decode(session["parts"]))
    load_compiler()  # a long backlog is then processed by compiled code
    return StreamEstimation(Estimation(conditioner, preset.bank()), stream, send)


if __name__ == "__main__":
    run_reader("estimation", in_process, PERIOD)
