"""Correlation of successive residuals, and the number of independent values that it leaves."""

from __future__ import annotations

from estimation.arrays import Floats

LARGEST = 0.99
"""Largest correlation that is assumed: with 1, no residual would be independent."""


def correlation_of_successive(residual: Floats) -> float:
    """Return the correlation of successive values of a residual, from 0 to `LARGEST`."""
    products = float(residual[1:] @ residual[:-1])
    return min(max(products / max(float(residual @ residual), 1e-300), 0.0), LARGEST)


def effective_samples(residual: Floats) -> float:
    """Return the number of independent values with the information of n correlated values.

    It is that of a noise of first order, n (1 - r) / (1 + r) with the correlation r of successive
    values.
    """
    correlation = correlation_of_successive(residual)
    return max(len(residual) * (1.0 - correlation) / (1.0 + correlation), 2.0)
