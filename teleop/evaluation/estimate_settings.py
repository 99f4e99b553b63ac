"""Settings of the evaluation of a recording."""

from __future__ import annotations

from dataclasses import dataclass

from estimation import Model, Preset
from teleop.names import ConditioningName, PresetName


@dataclass(frozen=True)
class EstimateSettings:
    """Settings of an evaluation."""

    datum: str = "auto"
    """`auto`, `contact`, `file`, `start`, `mean`, or a position and a force such as `1.5mm,20N`."""
    preset: PresetName | Preset = "scaled"
    """Parameters of the estimators: `scaled` from the data, those of the `paper`, or a preset."""
    estimators: tuple[str, ...] | None = None
    """Names of the estimators; None for those of the preset."""
    model: Model | None = None
    """Model of the estimators that support several models; None for that of the preset."""
    cube: str = "soft"
    """Cube that selects the adaptation gain of the paper's preset."""
    conditioning: ConditioningName = "matched"
    bandwidth: float | None = None
    """Bandwidth of the conditioning [Hz]; None for ten times the upper end of the coherent band."""
    force_lag: float | None = None
    """Lag of the force channel [s]; matched conditioning compensates for it. None for the delay
    of the force filter that the file states, and no lag if it states none."""
    whole: bool = False
    """Whether to include rest before and after the motion."""
    resolution: float | None = None
    """Position of one encoder count [m]; None for the smallest step in the data."""
