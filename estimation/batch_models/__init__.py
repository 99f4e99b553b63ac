"""Fit models of the environment to a record, with confidence intervals and goodness of fit.

A batch model is fitted to all samples together.
"""

from __future__ import annotations

from estimation.batch_models.fit import BatchData, BatchFit, Parameter
from estimation.batch_models.hunt_crossley import fit_hunt_crossley
from estimation.batch_models.linear import COLUMNS, fit_linear
from estimation.batch_models.standard_linear_solid import fit_standard_linear_solid

__all__ = ["MODELS", "BatchData", "BatchFit", "Parameter", "compare_models"]

MODELS = (*COLUMNS, "hunt-crossley", "standard linear solid")
"""Names of the models."""


def compare_models(data: BatchData) -> list[BatchFit]:
    """Fit all models to a record, and return the fits, the best fit first.

    The best fit is the one with the smallest Bayesian information criterion.
    """
    fits = [fit_linear(name, data) for name in COLUMNS]
    fits += [fit_hunt_crossley(data), fit_standard_linear_solid(data)]
    return sorted(fits, key=lambda fit: fit.bic)
