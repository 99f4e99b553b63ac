"""Summarise the settings of an evaluation, which are reported together with its results."""

from __future__ import annotations

from typing import Any

from teleop.evaluation.estimate_settings import EstimateSettings
from teleop.software import software


def settings_summary(settings: EstimateSettings) -> dict[str, Any]:
    """Return the settings that influenced the result of an evaluation, for a report.

    The keys are `software` (version and commit), `conditioning` (filters of position and force)
    and `force_lag_s` (the setting of the force lag [s]; 0 if it is not set).
    """
    return {
        "software": f"teleop {software()}",
        "conditioning": settings.conditioning,
        "force_lag_s": settings.force_lag or 0.0,
    }
