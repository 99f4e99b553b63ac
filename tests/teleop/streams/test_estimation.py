"""Estimates computed in blocks are those of single samples, and of the recording, to the bit."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from estimation import MODELS, Bank, MatchedFilter, paper_preset
from estimation.registry import BUILT_IN
from teleop.cli import main
from teleop.recording.recording import load
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.columns import Layout
from teleop.streams.estimation import FEW, Estimation, StreamEstimation
from teleop.streams.stream import Stream
from teleop.trial.run import run_trial

from .filled import record_at

SETTINGS = TrialSettings(clock="virtual", duration=1.2)


def in_blocks(settings, block):
    """Return the recording of a trial whose estimates are computed after each block of ticks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("teleop.trial.readers.BLOCK", block)
        patch.setattr("teleop.streams.estimation.BLOCK", block)
        return run_trial(settings).recording


@pytest.mark.parametrize(
    "changes",
    [
        {"estimators": tuple(BUILT_IN)},
        {"model": MODELS["stiffening"], "estimators": ("rls_conditional", "rls")},
        {"conditioning": "foaw", "condition": "autonomous", "rate": 400.0},
    ],
)
def test_blocks_of_any_size_give_the_same_recording_as_one_tick_at_a_time(changes):
    settings = replace(SETTINGS, **changes)
    expected = in_blocks(settings, 1)
    assert np.isfinite(expected["x"]).sum() > 400
    for block in (FEW - 5, 77, 10_000):
        got = in_blocks(settings, block)
        assert got.events == expected.events
        for name, column in expected.columns.items():
            np.testing.assert_array_equal(got[name], column, err_msg=f"{name}, blocks of {block}")


class Ticks:
    """A stream, and the estimation that reads it."""

    def __init__(self, ticks=2000):
        self.bank = paper_preset().bank()
        self.stream = Stream(Layout(self.bank), ticks)
        self.reader = self.stream.reader()
        self.messages = []
        estimation = Estimation(MatchedFilter(20.0), self.bank)
        self.estimation = StreamEstimation(estimation, self.reader, self.messages.append)

    def write(self, count, every=1):
        """Write ticks, of which each n-th one has a pair of position and force."""
        for _ in range(count):
            n = self.stream.newest + 1
            t, pair = 1e-3 * n, ()
            if n % every == 0:
                x = 4e-3 * (1.0 - np.cos(12.0 * t))
                pair = (x, 2000.0 * x, 1e-3 * every)
            self.stream.write(record_at(t, *pair))

    def columns(self):
        return self.reader.columns(1, self.stream.newest + 1)


def test_only_ticks_with_a_pair_have_estimates_and_nothing_else_is_held():
    ticks = Ticks()
    ticks.write(400, every=4)
    ticks.estimation.advance()
    columns = ticks.columns()
    paired = np.arange(1, 401) % 4 == 0
    for name in ("x", "v", "f", "rls_k", "rls_b"):
        np.testing.assert_array_equal(np.isfinite(columns[name]), paired, err_msg=name)
    assert not columns["rls_held"][~paired].any()
    assert np.isnan(columns["me_misfit"][~paired]).all()


def test_an_estimation_that_was_stopped_too_long_counts_the_ticks_that_it_missed():
    ticks = Ticks(ticks=300)
    ticks.write(100)
    ticks.estimation.advance()
    ticks.write(1500)
    ticks.estimation.finish()
    assert ticks.reader.estimates.newest == 1600
    oldest = ticks.reader.ticks.oldest
    assert ticks.reader.missed == oldest - 101
    columns = ticks.reader.columns(oldest, 1601)
    assert len(columns["time"]) >= 300
    assert np.isfinite(columns["rls_k"]).all()


def fail_after(monkeypatch, samples, error):
    """Let the estimators raise an exception in the first block after a number of samples."""
    run, update, count = Bank.run, Bank.update, [0]

    def failing(call, length):
        def counted(bank, x, *others):
            count[0] += length(x)
            if count[0] > samples:
                raise error
            return call(bank, x, *others)

        return counted

    monkeypatch.setattr(Bank, "run", failing(run, len))
    monkeypatch.setattr(Bank, "update", failing(update, lambda x: 1))


@pytest.mark.parametrize("error", [ZeroDivisionError("by design"), SystemExit("by design")])
def test_after_an_exception_of_an_estimator_the_later_estimates_are_unknown(monkeypatch, error):
    fail_after(monkeypatch, 100, error)
    ticks = Ticks()
    for _ in range(5):
        ticks.write(50)
        ticks.estimation.advance()
    (message,) = ticks.messages
    assert "by design" in message["failure"]
    assert type(error).__name__ in message["traceback"]
    columns = ticks.columns()
    assert np.isfinite(columns["rls_k"][:100]).all()
    assert np.isnan(columns["rls_k"][100:]).all()
    assert not columns["rls_held"][100:].any()


def test_ctrl_c_is_not_an_exception_of_an_estimator(monkeypatch):
    fail_after(monkeypatch, 0, KeyboardInterrupt())
    ticks = Ticks()
    ticks.write(5)
    with pytest.raises(KeyboardInterrupt):
        ticks.estimation.advance()


def test_estimates_that_were_not_recorded_are_counted_as_the_cause(monkeypatch, tmp_path, capsys):
    path = tmp_path / "a.mcap"
    with monkeypatch.context() as patch:
        fail_after(patch, 500, ZeroDivisionError("by design"))
        patch.setattr("teleop.trial.readers.BLOCK", 1)
        run_trial(SETTINGS, path)
    samples = np.isfinite(load(path)["paired_position"]).sum()
    assert main(["estimate", str(path), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert not summary["as_online"]
    assert summary["missing_estimates"] == samples - 500
    assert main(["estimate", str(path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert f"did not record the estimates of {samples - 500} of" in text
    assert "the settings are not those" not in text


@pytest.mark.parametrize("block", [1, 250, 10_000])
def test_an_estimator_that_fails_is_a_named_event_and_the_trial_goes_on_to_its_end(
    monkeypatch, tmp_path, block
):
    path = tmp_path / "a.mcap"
    with monkeypatch.context() as patch:
        fail_after(patch, 500, ZeroDivisionError("by design"))
        patch.setattr("teleop.trial.readers.BLOCK", block)
        trial = run_trial(SETTINGS, path)
    assert trial.fault is None
    assert trial.estimation_failure == "ZeroDivisionError: by design"
    assert "by design" in trial.estimation_traceback
    assert not trial.interrupted
    assert trial.summary()["estimation_failure"] == trial.estimation_failure
    recording = load(path)
    (event,) = [one for one in recording.events if one.get("source") == "estimation"]
    assert event["text"] == "no further estimates: ZeroDivisionError: by design"
    assert event["time"] <= recording["time"][-1]
    assert event["fault"] is None
    assert recording["time"][-1] > 1.19
    paired = np.isfinite(recording["paired_position"])
    assert paired.sum() > 1000
    k = recording["rls_k"][paired]
    assert np.isnan(k[500:]).all()
    assert np.isfinite(k[:200]).all() == (block < 10_000)
    assert trial.summary()["actual_duration_s"] > 1.19
    assert trial.summary()["pairs"] == paired.sum()
    result = run_trial(SETTINGS).result.summary["result"]
    assert trial.result.summary["result"] == result
    assert recording["commanded_slave_velocity"].any()


def test_estimates_that_an_exception_prevented_are_computed_from_the_recording(
    monkeypatch, tmp_path, capsys
):
    whole, path = tmp_path / "whole.mcap", tmp_path / "a.mcap"
    command = ["run", "--clock", "virtual", "--duration", "1.2", "--record"]
    assert main([*command, str(whole)]) == 0
    with monkeypatch.context() as patch:
        fail_after(patch, 500, ZeroDivisionError("by design"))
        patch.setattr("teleop.trial.readers.BLOCK", 250)
        capsys.readouterr()
        code = main([*command, str(path)])
    text = "the estimates are not complete: ZeroDivisionError: by design"
    *trace, stated = capsys.readouterr().err.splitlines()
    assert stated == f"teleop: {text}; teleop estimate {path} computes them"
    assert trace[0].startswith("Traceback")
    assert code == 1
    tables = []
    for recording in (whole, path):
        table = recording.with_suffix(".csv")
        assert main(["estimate", str(recording), "--out", str(table)]) == 0
        tables.append(table.read_text())
    assert tables[0] == tables[1]
