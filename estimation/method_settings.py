"""What the methods of a bank are made from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from estimation.methods.grid import Grid
from estimation.model import KELVIN_VOIGT, Model

LONGEST = 1e3
"""Longest memory [s] of methods other than the paper's."""


@dataclass(frozen=True)
class MethodSettings:
    """Settings from which every method computes its own parameters.

    The units and ranges are those of the estimators' parameters of the same names.
    """

    forgetting: float
    sample_period: float
    initial_covariance: tuple[float, float]
    adaptation_gain: tuple[float, float]
    ai_method: Literal["rk4", "exact"]
    grid: Grid
    forgetting_rate: float
    x_size: float = 5e-3
    """Typical displacement [m]."""
    v_size: float = 25e-3
    """Typical velocity [m/s]."""
    f_size: float = 10.0
    """Typical force [N]."""
    segment: float = 0.5
    """Length of the segments that are compared for misfit [s], about a period of the motion."""
    correlation: float = 1.0
    """Samples for each one whose noise is independent, as the conditioner gives it."""
    model: Model = KELVIN_VOIGT
    """Model of the methods that take any regressors."""

    @property
    def memory(self) -> float:
        """Time [s] in which the weight of a sample falls to 1/e, `LONGEST` at the most."""
        if self.forgetting == 1.0:
            return LONGEST
        return min(-self.sample_period / math.log(self.forgetting), LONGEST)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Typical size of each of the model's regressors."""
        return self.model.sizes(self.x_size, self.v_size, self.f_size)

    @property
    def covariance(self) -> tuple[float, ...]:
        """Diagonal of P0 of methods that are not the paper's, per N^2 of force variance."""
        return tuple(1e4 / size**2 for size in self.sizes)
