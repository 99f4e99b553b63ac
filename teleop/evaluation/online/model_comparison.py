"""Compare estimators on the same samples: accuracy, coverage of intervals, and computing time.

The coverage is the fraction of the intervals that contain the correct value.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation import BatchWindow, Estimates, Estimator, Regression, predicted_force
from estimation.arrays import Floats
from estimation.checks import checked_samples
from estimation.compiled import interpreted_sweep
from estimation.metrics import count_intervals
from estimation.model import KELVIN_VOIGT
from teleop.evaluation.online.thresholds import ROUNDING_OF_FORCE, WINDOW

TIMED = 2000
"""Number of samples over which the computing time of an estimator is measured."""


class Comparison(NamedTuple):
    """Errors of one estimator relative to reference values of b and k.

    The samples at the start of the record are omitted, because the estimator has not converged. The
    omitted time is `WINDOW`, but at most half of the record. All values are NaN if no sample of the
    record changed the estimate.
    """

    one_step_ratio: float
    """Root mean square error of the one-step prediction of the force, which predicts the force of
    each sample with the estimate after the previous sample. It is divided by the same error of
    batch least squares with a sliding window of length `WINDOW`."""
    k_error: float
    """Root mean square error of the stiffness, as a fraction of the reference value."""
    b_error: float
    """Root mean square error of the damping [N s/m]."""
    k_coverage: float
    """Fraction of the 95 % intervals of the stiffness that contain the reference value. There is
    one interval per sample. NaN if there are no intervals."""
    b_coverage: float
    """As `k_coverage`, for the damping."""


def compare(
    regression: Regression,
    bank: Mapping[str, Estimator],
    estimates: Mapping[str, Estimates],
    b: ArrayLike,
    k: ArrayLike,
) -> dict[str, Comparison]:
    """Compare the estimates of each estimator with reference values of b [N s/m] and k [N/m].

    Each reference is one number, or one value for each of the n samples.
    """
    running = RunningComparison(bank, estimates, regression.dt, b, k)
    running.begin(regression)
    for name, series in estimates.items():
        running.add(name, series)
    return running.result()


class Errors(NamedTuple):
    """Sums of squared errors and numbers of intervals of one estimator, over the compared samples.

    The values of `Comparison` are computed from them.
    """

    force: float = 0.0
    """Sum of the squares of the error of the one-step prediction of the force [N^2]."""
    k: float = 0.0
    """Sum of the squares of the relative error of the stiffness."""
    b: float = 0.0
    """Sum of the squares of the error of the damping [N^2 s^2/m^2]."""
    k_inside: float = 0.0
    """Number of samples at which the 95 % interval of the stiffness contains the reference."""
    k_intervals: float = 0.0
    """Number of samples at which the stiffness has an interval."""
    b_inside: float = 0.0
    """As `k_inside`, for the damping."""
    b_intervals: float = 0.0
    """As `k_intervals`, for the damping."""


class RunningComparison:
    """Compares estimators with reference values of b and k, in blocks of samples of a record.

    For each block, call `begin` once, and then `add` for each estimator. After the last block, call
    `result`. `dt` are sample periods of the record or of a part of it, for the median period and
    the time that is omitted at the start. References with one value per sample need one block.
    """

    def __init__(
        self,
        bank: Mapping[str, Estimator],
        names: Iterable[str],
        dt: Floats,
        b: ArrayLike,
        k: ArrayLike,
    ) -> None:
        self._errors = {name: Errors() for name in names}
        models = (bank[name].model for name in self._errors)
        model = next((m for m in models if m.further), KELVIN_VOIGT)
        self._reference = b, k
        self._start = min(WINDOW, 0.5 * float(dt.sum()))
        self._window = BatchWindow(WINDOW, sample_period=float(np.median(dt)), model=model)
        self._before: dict[str, Estimates] = {}
        self._known: set[str] = set()
        self._time = self._batch = self._force = 0.0
        self._samples = self._settled_samples = 0

    def begin(self, regression: Regression) -> None:
        """Begin the next block of the record.

        The parameter `regression` contains the samples of the block.
        """
        x, v, f, dt, further = regression
        times = np.cumsum(np.concatenate(([self._time], dt)))[1:]
        self._time = float(times[-1])
        self._regression, self._settled = regression, times > self._start
        self._samples += len(f)
        self._settled_samples += int(self._settled.sum())
        if self._errors:
            further_used = further if self._window.model.further else None
            self._batch += self._squares("", self._window.run(x, v, f, dt, further_used))
            self._force += float(np.sum(f**2))

    def add(self, name: str, series: Estimates) -> None:
        """Compare the estimates of one estimator in the block that `begin` began."""
        if name not in self._errors:
            return
        settled = self._settled
        b_now, k_now, b_std, k_std = (column[settled] for column in series[:4])
        true_b, true_k = (
            np.broadcast_to(np.asarray(truth), settled.shape)[settled] for truth in self._reference
        )
        new = Errors(
            self._squares(name, series),
            float(np.sum((k_now / true_k - 1.0) ** 2)),
            float(np.sum((b_now - true_b) ** 2)),
            *count_intervals(k_now, k_std, true_k),
            *count_intervals(b_now, b_std, true_b),
        )
        self._errors[name] = Errors(*map(sum, zip(self._errors[name], new, strict=True)))
        if not series.held.all():
            self._known.add(name)

    def _squares(self, name: str, series: Estimates) -> float:
        """Return the sum of the squared errors of the one-step force prediction in a block [N^2].

        The force of each sample is predicted with the estimate after the previous sample.
        """
        predicted = predicted_force(self._regression, series, self._before.get(name))
        self._before[name] = series.part(slice(-1, None))
        return float(np.sum((self._regression.f - predicted)[self._settled] ** 2))

    def result(self) -> dict[str, Comparison]:
        """Return the errors of each compared estimator over all blocks, by its name."""
        count = max(self._settled_samples, 1)
        batch = math.sqrt(self._batch / count)
        if batch < ROUNDING_OF_FORCE * math.sqrt(self._force / max(self._samples, 1)):
            batch = math.nan
        found = {}
        for name, e in self._errors.items():
            if name not in self._known:  # no estimate
                found[name] = Comparison(*(math.nan for _ in Comparison._fields))
                continue
            found[name] = Comparison(
                one_step_ratio=math.sqrt(e.force / count) / batch if batch else math.nan,
                k_error=math.sqrt(e.k / count),
                b_error=math.sqrt(e.b / count),
                k_coverage=e.k_inside / e.k_intervals if e.k_intervals else math.nan,
                b_coverage=e.b_inside / e.b_intervals if e.b_intervals else math.nan,
            )
        return found


def cost(estimator: Estimator, regression: Regression) -> float:
    """Measure the computing time of an estimator per sample on this machine [s].

    The estimator processes the same samples several times. The result is the shortest time, divided
    by the number of samples. It is slightly different in each call. The estimator runs as
    interpreted Python, which is slower than compiled code.
    """
    part = regression.part(slice(TIMED))
    further = part.further if estimator.model.further else None
    samples = estimator.step_samples(checked_samples(part.x, part.v, part.f, part.dt, further))
    best = math.inf
    for _ in range(3):
        fresh = deepcopy(estimator)
        fresh.reset()
        start = time.perf_counter()
        interpreted_sweep(fresh.law, fresh.state, samples)
        best = min(best, time.perf_counter() - start)
    return best / max(len(part.x), 1)
