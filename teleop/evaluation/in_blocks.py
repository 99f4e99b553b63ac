"""Compute the excitation and the misfit of a record in blocks of samples, to save memory.

Both computations convert arrays to Python objects, which take five times the memory of arrays. The
results are equal, bit by bit, to the results for all samples together.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from estimation import Bank, Estimates, Excitation, Misfit, Regression
from estimation.compiled import Floats

BLOCK = 1 << 16
"""Largest number of samples in a block."""


def blocks(count: int) -> list[slice]:
    """Return slices of at most `BLOCK` samples that cover `count` samples."""
    return [slice(start, start + BLOCK) for start in range(0, count, BLOCK)]


def excitation_of(measure: Excitation, regression: Regression) -> Floats:
    """Return the excitation after each sample, shape (n,)."""
    x, v, _, dt, _ = regression
    return np.concatenate([measure.run(x[s], v[s], dt[s]) for s in blocks(len(x))])


def misfit_of(
    misfit: Misfit, regression: Regression, estimates: Mapping[str, Estimates], bank: Bank
) -> dict[str, Floats]:
    """Return the misfit of each estimator after each sample, arrays of shape (n,).

    Parameters
    ----------
    misfit
        The misfit measure, which has processed no sample yet.
    regression
        The n samples that the estimators processed.
    estimates
        Estimates of each estimator after each sample.
    bank
        The estimators, which have processed all samples.
    """
    parts = [
        misfit.run(
            regression.part(block),
            {name: series.part(block) for name, series in estimates.items()},
            bank.opened[block],
        )
        for block in blocks(len(regression.x))
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in estimates}
