"""The points of a sweep: the values of the settings at each point, from the plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice, product
from typing import Any, NamedTuple

import numpy as np

from teleop.studies.sweep.plan import Range, SweepPlan


class Point(NamedTuple):
    """One point of a sweep."""

    number: int
    """Position in the sweep, from 1."""
    values: tuple[Any, ...]
    """Values of the factors, in the order of the plan."""
    repetition: int
    """Number of the repetition, from 0. It is added to the seed of the trial."""


def points_of(plan: SweepPlan) -> list[Point]:
    """Return the points of a plan, in their order.

    The repetitions of a point follow each other.
    """
    cells = random_values(plan) if plan.is_random else listed_values(plan)
    every = ((values, i) for values in cells for i in range(plan.seeds))
    return [Point(number, values, i) for number, (values, i) in enumerate(every, start=1)]


def listed_values(plan: SweepPlan) -> list[tuple[Any, ...]]:
    """Return the values of the factors at the points of a grid or a list."""
    values = [
        spaced(one, np.linspace(0.0, 1.0, one.steps or 0)) if isinstance(one, Range) else one
        for one in plan.factors.values()
    ]
    return [*(zip(*values, strict=True) if plan.design == "list" else product(*values))]


def random_values(plan: SweepPlan) -> list[tuple[Any, ...]]:
    """Return the values of the factors at the points of a random design.

    In a latin hypercube of n points, each of n equal parts of a range contains one value.
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
    """Return the values at shares of a range, from 0 for the lowest to 1 for the highest."""
    low, high = values.low, values.high
    inside = [float(share) for share in shares]
    if values.scale == "log":
        found = [low * (high / low) ** share for share in inside]
    else:
        found = [low + (high - low) * share for share in inside]
    return [high if share == 1.0 else value for share, value in zip(inside, found, strict=True)]


def chosen(values: Sequence[Any], shares: np.ndarray) -> list[Any]:
    """Return the values of a list at shares of its length, in [0, 1)."""
    return [values[math.floor(share * len(values))] for share in shares.tolist()]


def evenly(points: Sequence[Point], count: int) -> list[Point]:
    """Return about `count` points at equal distances in a sweep."""
    return [*islice(points, 0, None, max(1, len(points) // count))]
