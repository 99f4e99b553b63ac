"""Safety limits of a single trial, which are tighter than the safety limits of the rig."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

from teleop.safety.limits import Limits


@dataclass(frozen=True)
class TightenedLimits:
    """Limits of a trial that replace limits of the rig. None means that the rig's limit remains.

    Each limit must be at least as tight as the same limit of the rig. This class contains only the
    limits for which a tighter value is always safer. It does not contain the largest acceleration,
    for example, because a smaller acceleration makes every stop longer.
    """

    max_velocity: float | None = None
    """Largest commanded speed of the slave [m/s]."""
    max_master_velocity: float | None = None
    """Largest commanded speed of the master [m/s]."""
    soft_position: tuple[float, float] | None = None
    """Soft limits of the slave's position, lower and upper [m]; the slave stops at these limits."""
    hard_position: tuple[float, float] | None = None
    """Hard limits of the slave's position, lower and upper [m]."""
    soft_force: float | None = None
    """Soft limit: magnitude of the contact force above which the slave presses no further [N]."""
    hard_force: float | None = None
    """Hard limit of the magnitude of the contact force [N]."""
    following_error: float | None = None
    """Hard limit of the difference between commanded and measured travel of the slave [m]."""
    rest_master_force: float | None = None
    """Largest force on the handle at which the drives may be armed [N]."""

    @property
    def stated(self) -> dict[str, Any]:
        """The limits that replace limits of the rig, by the name of the limit."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def applied(self, limits: Limits) -> Limits:
        """Return the limits that are valid in the trial.

        A limit of this object that is not None replaces the same limit of the rig.
        """
        return replace(limits, **self.stated)

    def looser(self, limits: Limits) -> Iterator[tuple[str, Any, Any]]:
        """Yield each limit of this object that is looser than the limit of the rig.

        Each item consists of the name of the limit, its value in this object, and its value for the
        rig.
        """
        for name, value in self.stated.items():
            present = getattr(limits, name)
            if name.endswith("_position"):
                tight = present[0] <= value[0] and value[1] <= present[1]
            else:
                tight = value <= present
            if not tight:
                yield name, value, present


NOT_TIGHTENED = TightenedLimits()
"""Tightened limits of a trial that uses all limits of its rig unchanged."""
