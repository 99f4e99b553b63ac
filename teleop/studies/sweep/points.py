"""Compute the points of a sweep from its plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice, product
from typing import Any, NamedTuple

import numpy as np

from teleop.studies.sweep.plan import Range, SweepPlan


class Point(NamedTuple):
    """One point of a sweep: values of the settings that vary, and the number of the repetition."""

    number: int
    """Position of the point in the sweep, from 1."""
    values: tuple[Any, ...]
    """Values of the settings that vary, in the order of the plan."""
    repetition: int
    """Number of the repetition, from 0. It is added to the seed of the trial."""


def points_of(plan: SweepPlan) -> list[Point]:
    """Return the points of a plan, in the order in which they are run.

    Points that have the same values of the settings, and differ only in the number of the
    repetition, directly follow each other.
    """
    cells = random_values(plan) if plan.is_random else listed_values(plan)
    every = ((values, i) for values in cells for i in range(plan.seeds))
    return [Point(number, values, i) for number, (values, i) in enumerate(every, start=1)]


def listed_values(plan: SweepPlan) -> list[tuple[Any, ...]]:
    """Return the combinations of values of the factors in the design `grid` or `list`.

    Each combination contains one value of each factor.
    """
    values = [
        spaced(one, np.linspace(0.0, 1.0, one.steps or 0)) if isinstance(one, Range) else one
        for one in plan.factors.values()
    ]
    return [*(zip(*values, strict=True) if plan.design == "list" else product(*values))]


def random_values(plan: SweepPlan) -> list[tuple[Any, ...]]:
    """Return the combinations of values in the design `random` or `latin-hypercube`.

    Each combination contains one value of each factor. In a Latin hypercube with n combinations,
    the range of each factor is divided into n equal parts. Each part contains the value of exactly
    one combination.
    """
    count, size = plan.points or 0, len(plan.factors)
    generator = np.random.default_rng(plan.seed)
    shares = generator.random((count, size))
    if plan.design == "latin-hypercube":
        parts = generator.permuted(np.tile(np.arange(count), (size, 1)), axis=1)
        shares = (parts.T + shares) / count
    columns = [
        spaced(one, column) if isinstance(one, Range) else chosen(one, column)
        for one, column in zip(plan.factors.values(), shares.T, strict=True)
    ]
    return [*zip(*columns, strict=True)]


def spaced(values: Range, shares: Sequence[float] | np.ndarray) -> list[float]:
    """Return the values at given fractions of a range."""
    low, high = values.low, values.high
    inside = [float(share) for share in shares]
    if values.scale == "log":
        found = [low * (high / low) ** share for share in inside]
    else:
        found = [low + (high - low) * share for share in inside]
    return [high if share == 1.0 else value for share, value in zip(inside, found, strict=True)]


def chosen(values: Sequence[Any], shares: np.ndarray) -> list[Any]:
    """Return the items at given fractions of the length of a list."""
    return [values[math.floor(share * len(values))] for share in shares.tolist()]


def evenly(points: Sequence[Point], count: int) -> list[Point]:
    """Return some points of a sweep that are evenly distributed over all its points.

    At least `count` and fewer than 2 `count` points are returned. If the sweep has fewer than
    `count` points, all are returned.
    """
    return [*islice(points, 0, None, max(1, len(points) // count))]
