"""Define the names that can be chosen in the settings and options of a trial."""

from __future__ import annotations

from typing import Literal

ConditionName = Literal["free", "mimic", "autonomous"]
PalpationName = Literal["any", ConditionName]
CubeName = Literal["soft", "medium", "hard"]
ClockName = Literal["real", "virtual"]
SignalName = Literal["sine", "multisine", "chirp"]
CouplingName = Literal["velocity", "position"]
FeedbackName = Literal["none", "position-force", "model-mediated"]
RemovedFeedbackName = Literal["passivity"]
"""Laws of earlier versions. Their recordings are evaluated, but new trials are refused."""
ConditioningName = Literal["matched", "svf", "foaw", "difference"]
ModelName = Literal["kelvin-voigt", "datum", "inertia", "stiffening", "sls"]
PresetName = Literal["scaled", "paper"]
RealtimeName = Literal["require", "try", "off"]
WidthName = Literal["screen", "single", "double", "a4"]
ESTIMATOR_NAMES = (
    "rls",
    "ai",
    "me",
    "rls_conditional",
    "rls_directional",
    "rls_sift",
    "rls_trace",
    "kalman",
    "observer",
    "passive",
    "window",
    "ai_normalised",
    "indirect",
    "reference",
    "composite",
    "spectral",
    "hc_double",
    "hc_log",
    "me_switching",
    "me_moving",
    "segments",
)
"""Names of all estimators of this package."""
