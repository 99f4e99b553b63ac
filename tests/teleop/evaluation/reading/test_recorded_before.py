"""A recording of all estimators, made before they were rewritten, gives the same estimates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from estimation import METHODS
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.recorded import recorded_settings, recorded_signals
from teleop.recording.recording import load

RECORDING = Path(__file__).parents[3] / "data" / "estimates" / "all-estimators.mcap"


def test_it_loads_and_all_estimators_give_the_recorded_numbers():
    recording = load(RECORDING)
    recorded = recording.estimated().estimates()
    again = evaluate(recorded_signals(recording), recorded_settings(recording)).estimates
    assert list(recorded) == list(again)
    assert set(recorded) <= set(METHODS)
    assert len(recorded) == 21
    assert np.isnan(recording.misfit("rls")).all()  # not recorded at that time
    for name, online in recorded.items():
        for ours, theirs in zip(again[name][:5], online[:5], strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, err_msg=name)
        assert again[name].further.keys() == online.further.keys()
        for parameter, series in online.further.items():
            np.testing.assert_allclose(again[name].further[parameter].value, series.value, 1e-9)
            np.testing.assert_allclose(again[name].further[parameter].std, series.std, 1e-9)
