"""The three-factor finding: analysis of variance of the trials over many seeds.

Cube and control condition differ between trials; the estimators work on the same trials. So it
is a split-plot design: cube, condition and their interaction are held against the variance
between trials of one kind, the estimator and its interactions against its interaction with the
trial. Reference: R. E. Kirk, "Experimental Design", 4th ed., 2013, chapter 12.
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
FACTORS = ("cube", "condition", "estimator")


class Effect(NamedTuple):
    """One line of an analysis of variance."""

    source: str
    degrees: int
    error_degrees: int
    f: float
    p: float
    partial_eta_squared: float
    """Share of the variance that is not due to other effects."""
    eta_squared: float
    """Share of all variance."""


def responses(outcomes: Sequence[Outcome], name: str) -> NDArray[np.float64]:
    """A response as an array of shape (cubes, conditions, estimators, seeds)."""
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
    """Analysis of variance of a balanced split-plot design.

    Parameters
    ----------
    y
        Responses of shape (cubes, conditions, estimators, seeds): between trials vary the
        first two axes and the seed, within a trial the estimator.

    Returns
    -------
    The seven effects of the three factors, each with its F test and effect sizes.

    Raises
    ------
    ValueError
        Fewer than two seeds, or a response that is not finite.
    """
    from scipy.special import fdtrc

    if y.shape[-1] < 2:
        raise ValueError(f"an analysis of variance needs at least 2 seeds, got {y.shape[-1]}")
    if not np.isfinite(y).all():
        raise ValueError("a response is not finite, an estimate that never rose perhaps")
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
    """Sum of squares, over all responses, of the means over the axes that are not named."""
    others = tuple(axis for axis in range(y.ndim) if axis not in axes)
    means = y.mean(axis=others, keepdims=True)
    return float(np.sum((np.broadcast_to(means, y.shape) - y.mean()) ** 2))


def finding(effects: Sequence[Effect]) -> str:
    """What an analysis says to "only the choice of the estimation algorithm has an effect"."""
    largest = max(effects, key=lambda effect: effect.eta_squared)
    others = [
        effect.source for effect in effects if effect.p < 0.01 and effect.source != "estimator"
    ]
    verdict = f"Most variance is due to {largest.source} ({largest.eta_squared:.0%})"
    if not others:
        return f"{verdict}; only the estimator has an effect, as the paper says."
    return (
        f"{verdict}; unlike in the paper, these have an effect too (p < 0.01): {', '.join(others)}."
    )
