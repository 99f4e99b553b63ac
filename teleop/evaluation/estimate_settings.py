"""Define the settings of the evaluation of a recording."""

from __future__ import annotations

from dataclasses import dataclass

from estimation import Model, Preset
from teleop.evaluation.averaged_part import WHOLE, AveragedPart
from teleop.names import ConditioningName, CubeName, PresetName


@dataclass(frozen=True)
class EstimateSettings:
    """Settings of the evaluation of one recording or measurement file."""

    datum: str = "auto"
    """Position and force that are treated as zero (see `find_datum`): `auto`, `contact`, `file`,
    `start`, `mean`, or a position and a force such as `1.5mm,20N`."""
    preset: PresetName | Preset = "scaled"
    """Parameters of the estimators: `scaled` (computed from the data), `paper` (as in the paper of
    the estimators), or an object that contains the parameters."""
    estimators: tuple[str, ...] | None = None
    """Names of the estimators; None for the estimators of the preset."""
    model: Model | None = None
    """Model for the estimators that support several models; None for the model of the preset."""
    cube: CubeName = "soft"
    """Specimen of the paper, `soft`, `medium` or `hard`. The preset `paper` has a different
    adaptation gain for each of them."""
    conditioning: ConditioningName = "matched"
    """Name of the filters that compute displacement, velocity and force from the measured signals.
    """
    bandwidth: float | None = None
    """Bandwidth of the filters [Hz]. None: for the preset `scaled`, ten times the highest frequency
    at which the force follows the position; for other presets, `estimation.conditioning.BANDWIDTH`.
    In both cases, the bandwidth is at most half of the sampling rate."""
    force_lag: float | None = None
    """Lag of the measured force [s], which the conditioning `matched` compensates. None: the delay
    of the force filter that the file states, or no lag if the file states no filter."""
    whole: bool = False
    """Whether the estimators also process the rest before and after the motion."""
    resolution: float | None = None
    """Resolution of the position sensor [m]; None for the smallest step in the data."""
    averaged: AveragedPart = WHOLE
    """Part of the record from which k and b are computed, and over which the estimates of the
    online estimators are averaged."""
