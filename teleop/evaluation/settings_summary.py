"""Summarise the settings of an evaluation, which are reported together with its results."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from teleop.evaluation.estimate_settings import EstimateSettings


def settings_summary(settings: EstimateSettings) -> dict[str, Any]:
    """Return the settings that influenced the result of an evaluation, for a report.

    The keys are `software` (version of this program), `conditioning` (name of the filters of
    position and force) and `force_lag_s` (the setting of the force lag [s]; 0 if it is not set).
    """
    return {
        "software": f"teleop {version('teleop')}",
        "conditioning": settings.conditioning,
        "force_lag_s": settings.force_lag or 0.0,
    }
