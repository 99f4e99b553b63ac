"""Define the settings of the evaluation of a recording."""

from __future__ import annotations

from dataclasses import dataclass

from estimation import Model, Preset
from teleop.evaluation.averaged_part import WHOLE, AveragedPart
from teleop.names import ConditioningName, PresetName


@dataclass(frozen=True)
class EstimateSettings:
    """Settings of an evaluation."""

    datum: str = "auto"
    """Datum: `auto`, `contact`, `file`, `start`, `mean`, or a position and a force such as
    `1.5mm,20N`."""
    preset: PresetName | Preset = "scaled"
    """Parameters of the estimators: `scaled` (computed from the data), `paper` (those of the
    paper), or a preset."""
    estimators: tuple[str, ...] | None = None
    """Names of the estimators; None for the estimators of the preset."""
    model: Model | None = None
    """Model for the estimators that support several models; None for the model of the preset."""
    cube: str = "soft"
    """Cube for which the adaptation gain of the preset `paper` is chosen."""
    conditioning: ConditioningName = "matched"
    bandwidth: float | None = None
    """Bandwidth of the signal conditioning [Hz]; None for ten times the upper end of the coherent
    band, at most half of the sampling rate."""
    force_lag: float | None = None
    """Lag of the force channel [s], which matched conditioning compensates. None: the delay of the
    force filter that the file states, or no lag if the file states no filter."""
    whole: bool = False
    """Whether to include the rest before and after the motion."""
    resolution: float | None = None
    """Travel per encoder count [m]; None for the smallest step in the data."""
    averaged: AveragedPart = WHOLE
    """The part of the record that the result and the averages of the online estimates use."""
