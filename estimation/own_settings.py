"""Define settings of one estimator. They replace the settings that all estimators share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

from estimation.checks import check_size
from estimation.method_settings import SIZES
from estimation.methods.grid import Grid


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
