"""Define the grid of candidates (b, k) from which a multi-estimator selects its estimate."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.arrays import Floats
from estimation.checks import LARGEST

MOST = 10**8
"""Largest number of candidate values of one parameter."""


@dataclass(frozen=True)
class Axis:
    """Evenly spaced candidate values of b or k: `count` values from `first` to `last`.

    Raises
    ------
    ValueError
        There are fewer than two values or more than `MOST`, or `first` is not less than `last`.
    """

    first: float
    last: float
    count: int

    def __post_init__(self) -> None:
        if not -math.inf < self.first < self.last < math.inf:
            raise ValueError(f"candidates must increase, got {self.first} to {self.last}")
        if not max(-self.first, self.last) < LARGEST:
            raise ValueError(
                f"candidates must be below {LARGEST:g}, got {self.first} to {self.last}"
            )
        if not 2 <= self.count <= MOST or self.count != int(self.count):
            raise ValueError(
                f"an axis needs at least two candidates and at most {MOST:g}, got {self.count}"
            )

    @property
    def spacing(self) -> float:
        """Distance between adjacent candidate values."""
        return (self.last - self.first) / (self.count - 1)

    @property
    def values(self) -> Floats:
        """All candidate values, shape (count,)."""
        return self.first + self.spacing * np.arange(self.count, dtype=np.float64)

    @property
    def nearest_zero(self) -> int:
        """Index of the candidate value nearest to zero.

        If two values are equally near, it is the lower of their indices.
        """
        wanted = math.ceil(-self.first / self.spacing - 0.5)
        return min(max(wanted, 0), self.count - 1)


@dataclass(frozen=True)
class Grid:
    """Grid of candidates (b, k): each damping in `b` [N s/m] with each stiffness in `k` [N/m]."""

    b: Axis
    k: Axis

    @property
    def candidates(self) -> int:
        """Number of candidates (b, k), the product of the numbers of values of b and k."""
        return self.b.count * self.k.count
