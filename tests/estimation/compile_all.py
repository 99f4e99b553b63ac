"""Compile all estimators into numba's cache, which the tests use."""

from __future__ import annotations

from estimation import METHODS, paper_preset
from estimation.checks import checked_samples
from estimation.compiled import compiled_sweep

for make in METHODS.values():
    estimator = make(paper_preset())
    samples = estimator.step_samples(checked_samples([1e-3], [0.0], [2.0], 1e-3))
    compiled_sweep(estimator.law, estimator.state, samples)
