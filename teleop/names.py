"""Define the names that can be chosen in the settings and options of a trial."""

from __future__ import annotations

from typing import Literal

ConditionName = Literal["free", "mimic", "autonomous"]
PalpationName = Literal["any", ConditionName]
CubeName = Literal["soft", "medium", "hard"]
ClockName = Literal["real", "virtual"]
SignalName = Literal["sine", "multisine", "chirp", "ramp-hold", "designed"]
CouplingName = Literal["velocity", "position"]
FeedbackName = Literal["none", "position-force", "model-mediated"]
RemovedFeedbackName = Literal["passivity"]
"""Laws of earlier versions. Their recordings are evaluated, but new trials are refused."""
ConditioningName = Literal["matched", "svf", "foaw", "difference"]
ModelName = Literal["kelvin-voigt", "datum", "inertia", "stiffening", "sls"]
PresetName = Literal["scaled", "paper"]
RealtimeName = Literal["require", "try", "off"]
SideName = Literal["master", "slave"]
RecordedSideName = Literal[SideName, "both"]
WidthName = Literal["screen", "single", "double", "a4"]

FORCE_SENSOR = "force sensor"
"""Source of the force of the hand: a sensor in a handle that moves. This is the usual one."""
ISOMETRIC = "force sensor of a handle that does not move"
COUPLED = "virtual coupling of the master"
NO_HANDLE = "none: the rig has no handle"
