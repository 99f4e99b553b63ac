"""Define settings that replace the shared settings of a preset for one estimator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from estimation.estimator import Estimator
from estimation.method_settings import MethodSettings
from estimation.methods.grid import Grid


@dataclass(frozen=True)
class OwnSettings:
    """Settings that replace the shared settings of a preset for one estimator.

    A setting that is None has the value of the preset. Units and ranges are those of
    `MethodSettings`.
    """

    forgetting: float | None = None
    """Forgetting factor per sample."""
    initial_covariance: tuple[float, float] | None = None
    """Diagonal of the initial covariance of RLS."""
    adaptation_gain: tuple[float, float] | None = None
    """Adaptation gain for b and k."""
    ai_method: Literal["rk4", "exact"] | None = None
    """Integration of adaptive identification."""
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

    @property
    def stated(self) -> dict[str, Any]:
        """The settings that are not None, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}


def with_own_settings(
    name: str,
    make: Callable[[MethodSettings], Estimator],
    shared: MethodSettings,
    own: Mapping[str, OwnSettings],
) -> Estimator:
    """Return a new estimator. The settings for this estimator replace the shared settings.

    Parameters
    ----------
    name
        Name of the estimator.
    make
        Factory of the estimator.
    shared
        Settings of all estimators.
    own
        Settings of single estimators, which replace shared settings of the same name. The keys are
        the names of the estimators.

    Raises
    ------
    ValueError
        A setting is out of its range, or the estimator does not use it.
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
