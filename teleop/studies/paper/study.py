"""Analysis of variance of the trials over several seeds, with three factors.

Cube and control condition differ between trials, and all estimators run on the same trials. The
design is therefore a split plot. Cube, condition and their interaction are tested against the
variance between trials with the same cube and condition. The estimator and its interactions are
tested against the interaction of estimator and trial.

Reference: R. E. Kirk, "Experimental Design", 4th ed., 2013, chapter 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_backend import CUBES
from teleop.control.conditions import CONDITIONS
from teleop.studies.paper.table1 import ESTIMATORS
from teleop.studies.paper.trials import Outcome

RESPONSES = {"e_f": "Average force error [N]", "rise_time_s": "Rise time [s]"}
"""Responses that are analysed, with their headings."""
FACTORS = ("cube", "condition", "estimator")
"""Factors, in the order of the axes of a response."""


class Effect(NamedTuple):
    """One effect of an analysis of variance."""

    source: str
    """Factor, or factors of the interaction."""
    degrees: int
    """Degrees of freedom of the effect."""
    error_degrees: int
    """Degrees of freedom of the error."""
    f: float
    """F statistic."""
    p: float
    """p value of the F test."""
    partial_eta_squared: float
    """Sum of squares of the effect, divided by that of effect and error."""
    eta_squared: float
    """Sum of squares of the effect, divided by the total sum of squares."""


def responses(outcomes: Sequence[Outcome], name: str) -> NDArray[np.float64]:
    """Return a response as an array of shape (cubes, conditions, estimators, seeds).

    Parameters
    ----------
    outcomes
        Results of the nine trials for every seed.
    name
        Key of `RESPONSES`.
    """
    value = {
        (o.cube, o.condition, e, o.seed): o.estimates[e][name] for o in outcomes for e in ESTIMATORS
    }
    seeds = sorted({o.seed for o in outcomes})
    return np.array(
        [
            [[[value[q, c, e, s] for s in seeds] for e in ESTIMATORS] for c in CONDITIONS]
            for q in CUBES
        ],
        dtype=np.float64,
    )


def split_plot(y: NDArray[np.float64]) -> list[Effect]:
    """Return the analysis of variance of a balanced split-plot design.

    Parameters
    ----------
    y
        Responses, shape (cubes, conditions, estimators, seeds). Cube, condition and seed vary
        between trials; the estimator varies within a trial.

    Returns
    -------
    The seven effects of the three factors, each with its F test and effect sizes.

    Raises
    ------
    ValueError
        There are fewer than two seeds, or a response is not finite.
    """
    from scipy.special import fdtrc

    if y.shape[-1] < 2:
        raise ValueError(f"an analysis of variance needs at least 2 seeds, got {y.shape[-1]}")
    if not np.isfinite(y).all():
        raise ValueError("a response is not finite: possibly an estimate has no rise time")
    squares: dict[tuple[int, ...], float] = {}
    degrees: dict[tuple[int, ...], int] = {}
    for size in (1, 2, 3):
        for axes in combinations(range(3), size):
            squares[axes] = marginal_squares(y, axes) - sum(
                squares[part] for part in squares if set(part) < set(axes)
            )
            degrees[axes] = int(np.prod([y.shape[axis] - 1 for axis in axes]))
    total = float(np.sum((y - y.mean()) ** 2))
    kinds, seeds, estimators = y.shape[0] * y.shape[1], y.shape[3], y.shape[2]
    between = marginal_squares(y, (0, 1, 3)) - marginal_squares(y, (0, 1))
    within = total - between - sum(squares.values())
    errors = {
        False: (between, kinds * (seeds - 1)),
        True: (within, kinds * (seeds - 1) * (estimators - 1)),
    }
    effects = []
    for axes, square in squares.items():
        error, error_degrees = errors[2 in axes]
        f = (square / degrees[axes]) / (error / error_degrees) if error > 0.0 else np.inf
        effects.append(
            Effect(
                " x ".join(FACTORS[axis] for axis in axes),
                degrees[axes],
                error_degrees,
                float(f),
                float(fdtrc(degrees[axes], error_degrees, f)),
                square / (square + error),
                square / total,
            )
        )
    return effects


def marginal_squares(y: NDArray[np.float64], axes: tuple[int, ...]) -> float:
    """Return the sum over all responses of squared deviations of marginal means from the mean.

    Parameters
    ----------
    y
        Responses, shape (cubes, conditions, estimators, seeds).
    axes
        Axes of the marginal means; the mean is taken over the other axes.
    """
    others = tuple(axis for axis in range(y.ndim) if axis not in axes)
    means = y.mean(axis=others, keepdims=True)
    return float(np.sum((np.broadcast_to(means, y.shape) - y.mean()) ** 2))


def finding(effects: Sequence[Effect]) -> str:
    """Return a sentence that compares an analysis with the paper's finding.

    The paper states that "only the choice of the estimation algorithm has an effect".
    """
    largest = max(effects, key=lambda effect: effect.eta_squared)
    others = [
        effect.source for effect in effects if effect.p < 0.01 and effect.source != "estimator"
    ]
    verdict = f"Most variance is due to {largest.source} ({largest.eta_squared:.0%})"
    if not others:
        return f"{verdict}; only the estimator has an effect, as in the paper."
    return (
        f"{verdict}; unlike in the paper, there are other effects (p < 0.01): {', '.join(others)}."
    )
