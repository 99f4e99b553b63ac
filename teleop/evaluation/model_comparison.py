"""Compare estimators on the same samples: accuracy, coverage of intervals, and computing time."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation import BatchWindow, Estimates, Estimator, Regression, coverage, predicted_force
from estimation.checks import checked_samples
from estimation.compiled import Floats, interpreted_sweep
from estimation.model import KELVIN_VOIGT

WINDOW = 1.0
"""Window of batch least squares [s]. The one-step error of this method is the reference."""
ROUNDING = 1e-9
"""If the error of batch least squares is less than this fraction of the force, the ratio of the
errors is NaN."""
TIMED = 2000
"""Number of samples over which the computing time of an estimator is measured."""


class Comparison(NamedTuple):
    """Errors of one estimator relative to a reference (b, k).

    The first second is omitted; of a record shorter than two seconds, the first half.
    """

    one_step_ratio: float
    """Root mean square error of the force prediction one step ahead, divided by the same error of
    batch least squares over 1 s."""
    k_error: float
    """Root mean square error of the stiffness, as a fraction of the reference."""
    b_error: float
    """Root mean square error of the damping [N s/m]."""
    k_coverage: float
    """Fraction of the samples at which the 95 % interval of the stiffness contains the
    reference."""
    b_coverage: float
    """Fraction of the samples at which the 95 % interval of the damping contains the reference."""


def compare(
    regression: Regression,
    bank: Mapping[str, Estimator],
    estimates: Mapping[str, Estimates],
    b: ArrayLike,
    k: ArrayLike,
) -> dict[str, Comparison]:
    """Compare each estimator with a reference.

    Parameters
    ----------
    regression
        The n samples that the estimators processed.
    bank
        The estimators.
    estimates
        Estimates of each estimator after each sample.
    b, k
        The reference: damping [N s/m] and stiffness [N/m], as arrays of shape (n,) or as one number
        for all samples.
    """
    if not estimates:
        return {}
    x, v, f, dt, further = regression
    settled = np.cumsum(dt) > min(WINDOW, 0.5 * float(dt.sum()))
    true_b, true_k = (np.broadcast_to(np.asarray(truth), x.shape)[settled] for truth in (b, k))
    models = (bank[name].model for name in estimates)
    model = next((m for m in models if m.further), KELVIN_VOIGT)
    window = BatchWindow(WINDOW, sample_period=float(np.median(dt)), model=model)
    batch = window.run(x, v, f, dt, further if model.further else None)
    batch_error = rms((f - predicted_force(regression, batch))[settled])
    if batch_error < ROUNDING * rms(f):
        batch_error = math.nan
    found = {}
    for name, series in estimates.items():
        if series.held.all():  # no estimate
            found[name] = Comparison(*(math.nan for _ in Comparison._fields))
            continue
        b_now, k_now, b_std, k_std = (column[settled] for column in series[:4])
        error = rms((f - predicted_force(regression, series))[settled])
        found[name] = Comparison(
            one_step_ratio=error / batch_error,
            k_error=rms(k_now / true_k - 1.0),
            b_error=rms(b_now - true_b),
            k_coverage=coverage(k_now, k_std, true_k),
            b_coverage=coverage(b_now, b_std, true_b),
        )
    return found


def rms(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def cost(estimator: Estimator, regression: Regression) -> float:
    """Measure the computing time per sample on this machine [s], the shortest of three runs.

    The code is measured as interpreted Python. The result is different in each call.
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
