"""A trial ends when the result of the evaluation is as precise as wanted."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from teleop.cli import main
from teleop.control.wanted_precision import WantedPrecision
from teleop.recording.recording import load
from teleop.safety import Event
from teleop.safety.events import ACTIVE
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.trial.precision import Precision
from teleop.trial.precision_watch import forecast, half_width
from teleop.trial.run import run_trial

from ..streams.filled import FilledStream

SETTINGS = TrialSettings(
    condition="autonomous", clock="virtual", duration=6.0, until=WantedPrecision(0.02, 0.01)
)


def notes(trial):
    return [(e["time"], e["text"]) for e in trial.ticks.events if e["source"] == "precision"]


@pytest.fixture(scope="module")
def trial():
    return run_trial(SETTINGS)


def test_a_trial_in_virtual_time_ends_at_the_wanted_precision_and_states_it(trial):
    assert trial.precision["reached"]
    assert trial.summary()["actual_duration_s"] < 4.0
    last = next(e for e in trial.ticks.events if e["mode"] == "stopping")
    assert last["text"] == trial.precision["text"]
    assert "after" in last["text"]
    assert not trial.interrupted
    assert trial.fault is None
    result = trial.result.summary["result"]
    for part, most in SETTINGS.until.parts.items():
        assert result[f"{part}_high"] - result[f"{part}_low"] < 2.0 * most * result[part]


def test_the_same_seed_gives_the_same_statements_and_the_same_end(trial):
    assert notes(run_trial(SETTINGS)) == notes(trial)
    assert len(notes(trial)) >= 2


def test_the_evaluation_while_the_trial_runs_is_that_of_the_recording(trial):
    t, text = notes(trial)[0]
    short = replace(SETTINGS, until=None, duration=t)
    again = run_trial(replace(short, duration=6.0)).recording
    from teleop.evaluation.evaluate import batch_analysis
    from teleop.evaluation.reading.recorded import recorded_signals
    from teleop.trial.recorded_trial import estimate_settings

    part = again.where(again["time"] <= t)
    analysis = batch_analysis(recorded_signals(part), estimate_settings(again))
    assert f"b ± {100.0 * half_width(analysis, 'b'):.1f} %" in text


def test_a_trial_that_does_not_reach_the_precision_ends_at_its_duration(capsys, tmp_path):
    path = tmp_path / "trial.mcap"
    command = ["run", "--clock", "virtual", "--condition", "autonomous", "--duration", "2"]
    assert main([*command, "--until", "b=0.01%", "--record", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "wanted b ± 0.01 %; not reached: at the end b ± " in " ".join(shown.split())
    events = load(path).events
    assert [e["text"] for e in events if e["mode"] == "stopping"] == ["end of the trial"]


def test_a_wrong_precision_is_one_line(capsys):
    assert main(["run", "--until", "k=2mm", "--json"]) == 2
    assert "until 'k=2mm'" in capsys.readouterr().err


def test_the_forecast_is_that_of_an_interval_which_shrinks_with_the_root_of_the_time():
    history, wanted = [(2.0, {"k": 0.01, "b": 0.2})], WantedPrecision(k=0.02, b=0.1)
    assert forecast(None, history, wanted, 10.0) == "about 6 s more"
    assert forecast(None, history, wanted, 4.0) == "about 6 s more, and 4 s are left"
    assert forecast(None, [(2.0, {"k": math.nan, "b": 0.2})], wanted, 4.0) == "not known yet"


def test_an_interval_that_hardly_shrinks_is_not_promised_to_become_narrow():
    times, wanted = np.arange(1.0, 8.0), WantedPrecision(b=0.01)
    shrinks = [(t, {"b": 0.08 / math.sqrt(t)}) for t in times]
    assert forecast(None, shrinks, wanted, 100.0) == "about 57 s more"
    stays = [(t, {"b": math.hypot(0.08 / math.sqrt(t), 0.02)}) for t in times]
    text = "not expected with this motion, b approaches ± 2.0 %"
    assert forecast(None, stays, wanted, 100.0) == text


def test_a_precision_beyond_the_errors_of_the_transmission_is_not_promised(monkeypatch):
    monkeypatch.setattr("teleop.trial.precision_watch.permanent", lambda analysis, part: 0.15)
    text = forecast(None, [(2.0, {"b": 0.2})], WantedPrecision(b=0.1), 10.0)
    assert text == "not reachable by this motion, lag and lost motion alone give b ± 15 %"


@pytest.fixture
def process(trial):
    """The reader of the process for real time, its stream, and the rows of the ticks."""
    recording = trial.recording
    session = {
        "wanted": SETTINGS.until.text,
        "metadata": {"settings": {"json": json.dumps(recording.settings)}},
        "duration": SETTINGS.duration,
    }
    stream = FilledStream(Layout(SETTINGS.estimation_preset.bank()), 500)
    reader = stream.reader()
    rows = np.column_stack([recording[name] for name in stream.names])
    stream.event(Event(trial.armed["time"], ACTIVE, "armed"))
    sent = []
    return Precision(session, reader, sent.append), sent, reader, stream, rows


def test_the_process_for_real_time_gives_the_findings_of_the_loop(trial, process):
    precision, found, reader, stream, rows = process
    expected = notes(trial)
    due = [t for t, _ in expected]
    for row in rows:
        stream.fill(row)
        wanted = row[0] in due or stream.newest % 400 == 0
        if wanted:
            precision.advance()
    assert reader.missed == 0
    assert [f"{SETTINGS.until.text}: {one['text']}" for one in found] == [
        text for _, text in expected
    ]


def test_ticks_that_the_process_missed_are_a_gap_and_no_jump_of_the_motion(process):
    precision, _, reader, stream, rows = process
    for row in rows[:1200]:
        stream.fill(row)
        if stream.newest % 400 == 0:
            precision.advance()
    stream.fill(*rows[1200:2200])
    precision.advance()
    signals = precision._watch._signals()
    (gap,) = signals.gaps
    lost = reader.missed
    assert lost > 300
    assert signals.t[gap] == rows[1200 + lost, 0]
    assert signals.dt[gap] == pytest.approx(1e-3 * (lost + 1))


@pytest.mark.real_time
def test_a_trial_in_real_time_ends_at_the_wanted_precision():
    trial = run_trial(replace(SETTINGS, clock="real", duration=8.0, until=WantedPrecision(b=0.05)))
    assert trial.precision["reached"]
    assert trial.summary()["actual_duration_s"] < 7.5
