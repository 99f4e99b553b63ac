"""Fit models of the environment to a record, with confidence intervals and goodness of fit."""

from __future__ import annotations

from estimation.batch_models.compared import MODELS, compare_models
from estimation.batch_models.fit import BatchData, BatchFit, Parameter

__all__ = ["MODELS", "BatchData", "BatchFit", "Parameter", "compare_models"]
