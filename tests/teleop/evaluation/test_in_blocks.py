"""Misfit and expected intervals of a record do not depend on the size of the blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading import samples
from teleop.evaluation.reading.recorded import recorded_settings, recorded_signals
from teleop.recording.recording import load

RECORDING = Path(__file__).parents[2] / "data" / "estimates" / "all-estimators.mcap"


def test_blocks_of_any_size_give_the_same_bits(monkeypatch):
    recording = load(RECORDING)
    signals, settings = recorded_signals(recording), recorded_settings(recording)
    whole = evaluate(signals, settings)
    monkeypatch.setattr(samples, "LONGEST_SINGLE_BLOCK", 77)
    monkeypatch.setattr(samples, "BLOCK", 77)
    parts = evaluate(signals, settings)
    np.testing.assert_array_equal(parts.expected, whole.expected)
    assert np.isfinite(whole.expected.b[-1])
    for name, misfit in whole.misfit.items():
        assert np.array_equal(parts.misfit[name], misfit, equal_nan=True)
        assert np.isfinite(misfit).any() or "n" in whole.bank[name].names
