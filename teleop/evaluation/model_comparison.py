"""How estimators compare on the same samples: accuracy, honesty, and on request cost."""

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

YARDSTICK = 1.0
"""Window of batch least squares that one-step errors are held against [s]."""
ROUNDING = 1e-9
"""A yardstick below this share of the force is rounding, and nothing is held against it."""
TIMED = 2000
"""Samples over which an estimator's cost is measured."""


class Comparison(NamedTuple):
    """One estimator beside a reference (b, k), from the end of the first second on."""

    one_step_ratio: float
    """One-step error [N rms] over that of batch least squares over the last second."""
    k_error: float
    """Root mean square error of the stiffness, as a share of the reference."""
    b_error: float
    """Root mean square error of the damping [N s/m]."""
    k_coverage: float
    """Share of the samples whose 95 % interval of the stiffness holds the reference."""
    b_coverage: float
    """The same of the damping."""


def compare(
    regression: Regression,
    bank: Mapping[str, Estimator],
    estimates: Mapping[str, Estimates],
    b: ArrayLike,
    k: ArrayLike,
) -> dict[str, Comparison]:
    """Hold each estimator against a reference.

    Parameters
    ----------
    regression
        The samples that the estimators were given, n of them.
    bank
        The estimators.
    estimates
        What they made of the samples.
    b, k
        The reference: damping [N s/m] and stiffness [N/m], of shape (n,) or one number for all.
    """
    if not estimates:
        return {}
    x, v, f, dt, further = regression
    settled = np.cumsum(dt) > min(YARDSTICK, 0.5 * float(dt.sum()))
    true_b, true_k = (np.broadcast_to(np.asarray(truth), x.shape)[settled] for truth in (b, k))
    models = (bank[name].model for name in estimates)
    model = next((m for m in models if m.further), KELVIN_VOIGT)
    window = BatchWindow(YARDSTICK, sample_period=float(np.median(dt)), model=model)
    batch = window.run(x, v, f, dt, further if model.further else None)
    yardstick = rms((f - predicted_force(regression, batch))[settled])
    if yardstick < ROUNDING * rms(f):
        yardstick = math.nan
    found = {}
    for name, series in estimates.items():
        b_now, k_now, b_std, k_std = (column[settled] for column in series[:4])
        error = rms((f - predicted_force(regression, series))[settled])
        found[name] = Comparison(
            one_step_ratio=error / yardstick,
            k_error=rms(k_now / true_k - 1.0),
            b_error=rms(b_now - true_b),
            k_coverage=coverage(k_now, k_std, true_k),
            b_coverage=coverage(b_now, b_std, true_b),
        )
    return found


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def cost(estimator: Estimator, regression: Regression) -> float:
    """Time that this machine takes for a sample, interpreted [s]: the least of three runs.

    A measurement of the machine: it differs from call to call.
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
