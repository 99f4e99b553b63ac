"""Define settings of one estimator. They replace the settings that all estimators share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from estimation.checks import check_size
from estimation.estimator import Estimator
from estimation.method_settings import MethodSettings
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
        for name in ("x_size", "v_size", "f_size"):
            check_size(name, getattr(self, name))

    @property
    def stated(self) -> dict[str, Any]:
        """The fields that are not None, as a dictionary from field name to value."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


def with_own_settings(
    name: str,
    make: Callable[[MethodSettings], Estimator],
    shared: MethodSettings,
    own: Mapping[str, OwnSettings],
) -> Estimator:
    """Return a new estimator. Its own settings replace the settings that all estimators share.

    Parameters
    ----------
    name
        Name of the estimator.
    make
        Function that constructs the estimator from the settings.
    shared
        Settings that all estimators share.
    own
        Own settings of each estimator, by the name of the estimator. An estimator that has no own
        settings may be missing.

    Raises
    ------
    ValueError
        A setting is out of its range, or the estimator does not use one of its own settings.
    """
    if name not in own:
        return make(shared)
    stated = own[name].stated
    used: set[str] = set()

    class Watched(type(shared)):  # type: ignore[misc]
        """Settings of the estimator. When a setting is read, its name is added to `used`."""

        def __getattribute__(self, attribute: str) -> Any:
            used.add(attribute)
            return super().__getattribute__(attribute)

    values = {f.name: getattr(shared, f.name) for f in fields(shared)} | stated
    estimator = make(Watched(**values))
    for setting in stated:
        if setting not in used:
            known = [f.name for f in fields(OwnSettings) if f.name in used]
            raise ValueError(
                f"{setting}: not a setting of this estimator: expected some of "
                f"{', '.join(known) or 'none'}"
            )
    return estimator
