"""Define the settings of the evaluation of a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import Model, Preset
from estimation.arrays import Floats
from estimation.transmission import RIGID, TransmissionCalibration
from teleop.names import ConditioningName, CubeName, PresetName
from teleop.software import software


class AveragedPart(NamedTuple):
    """The part of a record over which the estimates are averaged.

    The batch evaluation uses only this part. The online estimators process all samples of the
    record, but their averages and their final estimates are reported for this part only.
    """

    start: float = -math.inf
    """Time of the start of the part [s]."""
    end: float = math.inf
    """Time of the end of the part [s]."""
    left_out: str = ""
    """Description of the samples outside the part; empty if it is the whole record."""

    def after(self, time: float) -> AveragedPart:
        """Return the part of the record that starts and ends later than this part by `time` [s]."""
        return self._replace(start=self.start + time, end=self.end + time)

    def contains(self, t: Floats) -> NDArray[np.bool_]:
        """Return whether each of the times `t` [s], shape (n,), is in this part."""
        return (t >= self.start) & (t < self.end)

    def indices(self, t: Floats) -> slice:
        """Return the range of indices of the samples that are in this part, as a slice."""
        start, end = np.searchsorted(t, (self.start, self.end))
        return slice(int(start), int(end))


WHOLE = AveragedPart()
"""The whole record."""


def known_lag(settings: EstimateSettings) -> float | None:
    """Return the stated or calibrated lag of the force [s]; None if neither is known."""
    lag = settings.force_lag
    return settings.transmission.force_lag or None if lag is None else lag


def online_transmission(settings: EstimateSettings) -> TransmissionCalibration:
    """Return the lag and the lost motion for which the online estimates are corrected."""
    known = settings.online or settings.transmission
    lag, share = settings.force_lag or 0.0, 0.0  # a stated lag is of first order
    if settings.force_lag is None and settings.conditioning == "matched":
        lag, share = known.force_lag, known.delay_share
    return TransmissionCalibration(lag, known.lost_motion, delay_share=share)


def settings_summary(settings: EstimateSettings) -> dict[str, Any]:
    """Return the settings that influenced the result of an evaluation, for a report.

    The keys are `software` (version and commit), `conditioning` (filters of position and force),
    `force_lag_s` and `lost_motion_m` (lag of the force [s] and lost motion [m] for which the online
    estimates are corrected; 0 if not), and `transmission` (the values that correct the result; None
    if they are not known).
    """
    used, online = settings.transmission, online_transmission(settings)
    return {
        "software": f"teleop {software()}",
        "conditioning": settings.conditioning,
        "force_lag_s": online.force_lag,
        "lost_motion_m": online.lost_motion,
        "transmission": None
        if used == RIGID
        else {
            "force_lag_s": used.force_lag or settings.force_lag or 0.0,
            "lost_motion_m": used.lost_motion,
            "compliance_m_per_n": used.compliance,
        },
    }


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
    """Lag of the measured force [s], for which the conditioning `matched` corrects the position.
    None: the lag of `transmission`; if it is 0, the delay of the force filter that the file states.
    """
    transmission: TransmissionCalibration = RIGID
    """Calibrated lag, lost motion and compliance between encoder and tip. The lost motion is
    removed from the position, and the result contains the stiffness at the tip."""
    online: TransmissionCalibration | None = None
    """Lag and lost motion for which the online estimates are corrected, as in a recorded trial.
    None: those of `transmission`."""
    whole: bool = False
    """Whether the estimators also process the rest before and after the motion."""
    resolution: float | None = None
    """Resolution of the position sensor [m]; None for the smallest step in the data."""
    averaged: AveragedPart = WHOLE
    """Part of the record from which k and b are computed, and over which the estimates of the
    online estimators are averaged."""
