"""The target of the mimic condition."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.cli import main
from teleop.control.excitation_signals import Sine
from teleop.control.target import Target
from teleop.errors import InputError
from teleop.settings.configuration import read_configuration
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.metadata import to_document
from teleop.trial.run import run_trial

QUICK = {"clock": "virtual", "estimators": ("rls",)}


def test_the_target_moves_between_a_light_touch_and_the_depth_after_the_count_in():
    target = Target(frequency=0.5, depth=10e-3, count_in=3.0)
    assert [target.position(t) for t in (0.0, 3.0, 4.0, 5.0)] == pytest.approx(
        [1e-3, 1e-3, 10e-3, 1e-3]
    )


def test_the_target_is_recorded_while_the_drives_are_active():
    settings = TrialSettings("mimic", duration=1.0, depth=5e-3, count_in=0.3, **QUICK)
    recording = run_trial(settings).recording
    t, target = recording["time"], recording["target"]
    moving = np.isfinite(target)
    assert moving[(t > 0.01) & (t < 0.99)].all()
    assert not moving[t < 0.0].any()
    began = t[moving][np.flatnonzero(np.diff(target[moving]))[0]]
    assert began == pytest.approx(0.3, abs=5e-3)
    assert 0.5e-3 <= target[moving].min() < target[moving].max() <= 5e-3


@pytest.mark.parametrize("condition", ["free", "autonomous"])
def test_the_other_conditions_have_no_target(condition):
    trial = run_trial(TrialSettings(condition, duration=0.5, **QUICK))
    assert np.isnan(trial.recording["target"]).all()
    assert trial.summary()["tracking"] is None


@pytest.mark.parametrize("frequency", [0.5, 1.5])
def test_the_simulated_operator_follows_the_frequency_of_the_target(frequency):
    trial = run_trial(TrialSettings("mimic", duration=6.0, signal=Sine(frequency), **QUICK))
    tracking = trial.summary()["tracking"]
    assert tracking["target_hz"] == frequency
    assert tracking["frequency_hz"] == pytest.approx(frequency, rel=0.1)


def test_the_frequency_of_the_target_is_an_option_and_is_recorded_and_printed(capsys, tmp_path):
    path = tmp_path / "a.mcap"
    arguments = ["--condition", "mimic", "--clock", "virtual", "--estimators", "rls"]
    options = ["--frequency", "1.5", "--duration", "4", "--details", "--record", str(path)]
    assert main(["run", *arguments, *options]) == 0
    assert read_configuration(path).target.frequency == 1.5
    assert "of 1.5 Hz" in capsys.readouterr().out


def test_a_target_other_than_a_sine_is_refused(refused):
    assert "expected a sine" in refused("run", "--condition", "mimic", "--signal", "chirp")
    with pytest.raises(InputError, match="count_in -1 s"):
        TrialSettings("mimic", count_in=-1.0)


def test_a_recording_made_before_there_was_a_target_runs_with_the_operators_own_frequency(
    tmp_path, monkeypatch
):
    older = to_document(TrialSettings("mimic"))
    del older["count_in_s"]
    older["signal"] = {"kind": "sine", "frequency": 2.0}
    monkeypatch.setattr("teleop.trial.metadata.to_document", lambda settings: older)
    run_trial(TrialSettings(duration=0.3, **QUICK), tmp_path / "old.mcap")
    assert read_configuration(tmp_path / "old.mcap").target.frequency == 1.0
