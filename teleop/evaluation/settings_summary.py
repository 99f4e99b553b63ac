"""Summarise the settings of an evaluation that are stated together with the results."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from teleop.evaluation.estimate_settings import EstimateSettings


def settings_summary(settings: EstimateSettings) -> dict[str, Any]:
    """Return software version, conditioning and force lag of an evaluation."""
    return {
        "software": f"teleop {version('teleop')}",
        "conditioning": settings.conditioning,
        "force_lag_s": settings.force_lag or 0.0,
    }
