"""A long recorded trial is evaluated in blocks, with the results of a trial in memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from estimation import MODELS
from teleop.cli import main
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.errors import InputError
from teleop.evaluation.reading import recorded as kept_parts
from teleop.evaluation.teleoperation import loop_oscillation, rendering
from teleop.evaluation.teleoperation.tracking import tracking
from teleop.recording import recording_file, recovery, stream, timing
from teleop.recording.mcap_reader import read_intact
from teleop.recording.recording import load
from teleop.recording.recording_file import RecordingFile, recorded_ticks
from teleop.recording.recovery import messages, write_contents
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import tracked_ticks
from teleop.trial.run import run_trial

STIFFENING = MODELS["stiffening"]
QUICK = TrialSettings(clock="virtual", duration=2.0, seed=2)
TRIALS = {
    "free": QUICK,
    "mimic with count-in": replace(QUICK, condition="mimic", count_in=1.0),
    "autonomous": replace(QUICK, condition="autonomous", estimators=("kalman", "segments", "me")),
    "stiffening": replace(QUICK, model=STIFFENING, estimators=("rls_conditional",)),
    "feedback and channel": replace(
        QUICK,
        duration=5.0,
        feedback=FeedbackSettings("model-mediated"),
        channel=ChannelSettings(50e-3, 5e-3, 0.02),
    ),
}


@pytest.fixture
def small(monkeypatch):
    """Make all blocks short, so that a trial of seconds is long."""
    monkeypatch.setattr(recording_file, "MOST_VALUES_IN_MEMORY", 1000)
    monkeypatch.setattr(stream, "BLOCK", 300)
    monkeypatch.setattr(loop_oscillation, "FIRST", 1500)


@pytest.fixture(scope="module", params=TRIALS)
def trial(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("long") / "trial.mcap"
    trial = run_trial(TRIALS[request.param], path)
    rewrite_in_small_chunks(path)
    return trial


def rewrite_in_small_chunks(path):
    """Write a recording again with 200 ticks in each chunk: a chunk is read at once."""
    contents, ticks = read_intact(path), list(messages(path))
    path.unlink()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recovery, "CHUNK", 200)
        write_contents(path, contents, ticks)


def in_blocks(trial):
    """Return the same trial, whose ticks are read from the recording in blocks."""
    ticks = recorded_ticks(trial.outcome.path)
    assert isinstance(ticks, RecordingFile)
    return replace(trial, ticks=ticks)


def assert_close(found, expected, where=""):
    """Assert that two JSON documents are equal, except for rounding errors of sums."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), where
        for key in expected:
            assert_close(found[key], expected[key], f"{where}.{key}")
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-15, nan_ok=True), where
    else:
        assert found == expected, where


def test_the_summary_of_a_trial_in_blocks_is_that_of_the_trial_in_memory(trial, small, monkeypatch):
    expected, long = trial.summary(), in_blocks(trial)
    monkeypatch.setattr(recording_file, "MOST_VALUES_IN_MEMORY", 1 << 22)  # all ticks are shown
    assert len(list(long.ticks.blocks())) > 3
    assert_close(long.summary(), expected)


def test_all_ticks_of_a_long_trial_can_be_loaded(trial, small):
    long = in_blocks(trial)
    assert np.array_equal(long.t, trial.t)
    for name, column in trial.columns.items():
        np.testing.assert_array_equal(long.columns[name], column)


def test_figures_and_texts_of_a_long_trial_have_evenly_spaced_ticks_and_the_last(
    trial, small, monkeypatch
):
    monkeypatch.setattr(recording_file, "MOST_VALUES_IN_MEMORY", 30_000)
    long = in_blocks(trial)
    shown = long.shown.t
    assert 0.02 * len(trial.t) < len(shown) < 0.9 * len(trial.t)
    assert (shown[0], shown[-1]) == (trial.t[0], trial.t[-1])
    assert len(set(np.round(np.diff(shown[:-1]), 9))) == 1
    k = long.plot().axes[0].get_lines()[0].get_ydata()
    assert 0 < len(k) < len(trial.t)
    assert (repr(long), long._repr_html_()) == (repr(trial), trial._repr_html_())
    long.plot_force()


def test_the_tracking_of_a_long_trial_is_that_of_its_last_ticks(tmp_path, small, monkeypatch):
    monkeypatch.setattr(kept_parts, "LAST", 3000)
    settings = replace(QUICK, condition="mimic", duration=6.0)
    long = run_trial(settings, tmp_path / "long.mcap")
    rewrite_in_small_chunks(tmp_path / "long.mcap")
    found = long.tracking()
    assert 2 <= found["periods"] < 6
    last = slice(-len(tracked_ticks(long.ticks)), None)
    columns = (long.recording[name][last] for name in ("time", "target", "slave_position"))
    assert found == tracking(*columns, 1.0)._asdict()
    assert long.plot_tracking().axes[0].get_lines()


def test_the_command_prints_and_draws_a_long_trial(tmp_path, small, capsys):
    figure, path = tmp_path / "k.svg", tmp_path / "a.mcap"
    command = ["run", "--clock", "virtual", "--duration", "2", "--record", str(path)]
    assert main([*command, "--plot", str(figure), "--plot-force", str(tmp_path / "f.png")]) == 0
    assert "rls" in capsys.readouterr().out
    assert "rls" in figure.read_text()
    assert len(load(path)) > 2000


def test_the_memory_of_a_summary_does_not_depend_on_the_duration(tmp_path, small, monkeypatch):
    monkeypatch.setattr(timing, "MERGED", 200)
    monkeypatch.setattr(timing, "MOST", 100)
    monkeypatch.setattr(timing, "DIGITS", 4)
    monkeypatch.setattr(kept_parts, "LAST", 1000)
    monkeypatch.setattr(rendering, "MOST_BLOCKS", 50)
    settings = replace(
        QUICK, condition="mimic", estimators=("rls",), channel=ChannelSettings(delay=1e-3)
    )
    peaks = {}
    for duration in (3, 9):
        path = tmp_path / f"{duration}.mcap"
        trial = run_trial(replace(settings, duration=float(duration)), path)
        rewrite_in_small_chunks(path)
        if not peaks:
            replace(trial).summary()  # imports libraries
        tracemalloc.start()
        in_blocks(trial).summary()
        peaks[duration] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peaks[9] < 1.3 * peaks[3]


def test_a_recorded_trial_of_eight_hours_is_accepted(tmp_path):
    settings = TrialSettings(duration=8 * 3600.0, clock="virtual")
    with pytest.raises(InputError, match="28800 s without a recording: expected at most 3600 s"):
        run_trial(settings)


def test_a_file_that_disappears_after_the_trial_is_reported(tmp_path, small):
    path = tmp_path / "a.mcap"
    trial = run_trial(replace(QUICK, duration=1.0), path)
    path.unlink()
    with pytest.raises(InputError, match=str(path)):
        trial.summary()
