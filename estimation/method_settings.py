"""Settings that estimators share, and settings of one estimator that replace them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

from estimation.checks import check_size
from estimation.methods.grid import Grid
from estimation.model import KELVIN_VOIGT, Model

SIZES = ("x_size", "v_size", "f_size")
"""Settings from which `MethodSettings.sizes` and `MethodSettings.covariance` are computed."""
LONGEST = 1e3
"""Upper bound of `MethodSettings.memory` [s]."""


@dataclass(frozen=True)
class MethodSettings:
    """Settings of all estimators. The arguments of each estimator are computed from them.

    `forgetting`, `sample_period` and `initial_covariance` are explained in `RecursiveLeastSquares`.
    `adaptation_gain` and `ai_method` are the arguments `gain` and `method` of
    `AdaptiveIdentification`. `grid` and `forgetting_rate` are explained in `MultiEstimator`.
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
    """Length of a segment in the estimator `segments` [s], about one period of the motion."""
    correlation: float = 1.0
    """Correlation length of the force noise, in samples, see `Conditioner.correlation`."""
    model: Model = KELVIN_VOIGT
    """Model of the estimators that support models other than Kelvin-Voigt."""

    @property
    def memory(self) -> float:
        """Time constant of forgetting [s]: the weight of a sample decreases to 1/e in this time.

        The value is limited to 1000 s. This limit is returned if there is no forgetting.
        """
        if self.forgetting == 1.0:
            return LONGEST
        return min(-self.sample_period / math.log(self.forgetting), LONGEST)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Typical root mean square of each regressor of the model, in its SI unit."""
        return self.model.sizes(self.x_size, self.v_size, self.f_size)

    @property
    def covariance(self) -> tuple[float, ...]:
        """Initial variance of each parameter, for force noise with a variance of 1 N^2.

        The values are computed from `sizes`. Recursive least squares does not use the values of b
        and k as its initial variances. It uses `initial_covariance`, as in the paper.
        """
        return tuple(1e4 / size**2 for size in self.sizes)


@dataclass(frozen=True)
class OwnSettings:
    """Settings of one estimator. They replace the settings that all estimators share.

    `MethodSettings` contains the shared settings, with the same names, units and ranges. If a field
    here is None, the estimator uses the shared setting.
    """

    forgetting: float | None = None
    """Forgetting factor per sample."""
    initial_covariance: tuple[float, float] | None = None
    """Initial variances of b and k in recursive least squares."""
    adaptation_gain: tuple[float, float] | None = None
    """Gains of b and k in adaptive identification."""
    ai_method: Literal["rk4", "exact"] | None = None
    """Method of numerical integration in adaptive identification."""
    grid: Grid | None = None
    """Candidates of the multi-estimator."""
    forgetting_rate: float | None = None
    """Forgetting rate of the multi-estimator [1/s]."""
    x_size: float | None = None
    """Typical displacement [m]."""
    v_size: float | None = None
    """Typical velocity [m/s]."""
    f_size: float | None = None
    """Typical force [N]."""
    segment: float | None = None
    """Length of a segment of the estimator `segments` [s]."""

    def __post_init__(self) -> None:
        for name in SIZES:
            check_size(name, getattr(self, name))

    @property
    def stated(self) -> dict[str, Any]:
        """The fields that are not None, as a dictionary from field name to value."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def refuse_unused(self, used: Sequence[str] | None) -> None:
        """Raise ValueError if a setting is stated that is not in `Estimator.used_settings`."""
        for setting in self.stated:
            if used is not None and setting not in used:
                raise ValueError(
                    f"{setting}: not a setting of this estimator: expected some of "
                    f"{', '.join(used) or 'none'}"
                )
