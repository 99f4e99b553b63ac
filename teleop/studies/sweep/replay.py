"""Filter the samples of a recorded trial for the points of a sweep.

At each point, the estimators use the filtered samples. Points with the same settings of the filters
use the same filtered samples, so that these are computed only once.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from estimation import Model
from teleop.errors import InputError
from teleop.evaluation.online.conditioned import ConditionedSamples, conditioned
from teleop.evaluation.online.datum import OWN_ZERO
from teleop.evaluation.reading.recorded import recorded_signals
from teleop.recording.recording import load
from teleop.settings.configuration import as_recorded_now
from teleop.settings.problems import DERIVED
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import recorded_part


class RecordedTrial:
    """A recorded trial from which estimates are computed with other settings than in the trial."""

    def __init__(self, path: Path) -> None:
        recording = load(path)
        if not recording.settings:
            raise InputError(f"{path}: expected the recording of a trial, with its settings")
        recorded = as_recorded_now(recording.settings)
        self.document: dict[str, Any] = {
            key: value
            for key, value in recorded.items()
            if key not in DERIVED and value is not None
        }
        """Settings of the trial, with the keys of a configuration file."""
        self.averaged = recorded_part(recording)
        """The part of the trial over which the estimates are averaged."""
        self._signals = recorded_signals(recording)
        self._known: dict[tuple[str, float, float, float, float, Model], ConditionedSamples] = {}

    def conditioned(self, settings: TrialSettings) -> ConditionedSamples:
        """Return the samples of the trial after the filters that the settings state.

        The result is kept for later calls with the same settings of the filters. The caller must
        therefore not change its arrays.
        """
        preset = settings.estimation_preset
        known = settings.online_transmission
        key = (
            settings.conditioning,
            settings.bandwidth,
            known.force_lag,
            known.lost_motion,
            known.delay_share,
            preset.model,
        )
        if key not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            self._known[key] = conditioned(settings.make_conditioner(), self._signals, OWN_ZERO)
        return self._known[key]


KEPT = 20
"""Largest number of differently filtered versions of a recording that are kept in memory."""


@lru_cache(maxsize=2)
def recorded_trial(path: Path, content: str) -> RecordedTrial:
    """Return a recorded trial. Each process reads the file only once, unless the file changes."""
    return RecordedTrial(path)
