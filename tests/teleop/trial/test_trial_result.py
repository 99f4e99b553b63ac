"""The result of a trial is that of the evaluation of its recording, in every place."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from teleop.cli import main
from teleop.json_documents import dumps
from teleop.output.trial_tables import print_trial
from teleop.settings.trial_settings import TrialSettings
from teleop.trial import trial_result
from teleop.trial.live_documents import result_document
from teleop.trial.run import run_trial

SETTINGS = TrialSettings(clock="virtual", duration=4.0, seed=7)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("trial") / "trial.mcap"


@pytest.fixture(scope="module")
def trial(path):
    return run_trial(SETTINGS, path)


@pytest.fixture(scope="module")
def message(trial):
    """What the server of the live page receives about the result."""
    found = result_document(trial.result, trial.summary()["estimates"])
    return json.loads(dumps(found))


def test_dialog_terminal_json_and_report_show_the_same_numbers(
    trial, path, message, capsys, tmp_path
):
    capsys.readouterr()
    assert main(["estimate", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    for part in ("result", "best_model", "models", "transmission"):
        assert message[part] == document[part]
    assert document["result"]["k"]
    print_trial({**trial.summary(), **trial.result.summary}, details=False)
    printed = capsys.readouterr().out
    assert main(["estimate", str(path)]) == 0
    estimated = capsys.readouterr().out
    page = tmp_path / "page.html"
    assert main(["report", str(path), "--out", str(page)]) == 0
    report = page.read_text()
    values = message["shown"]["values"]
    assert [one["symbol"] for one in values] == ["k", "k at the tip", "b"]
    for one in values:
        for place in (printed, estimated, report):
            assert f"{one['symbol']} = {one['value']} {one['unit']}" in place
            assert f"interval {one['low']} to {one['high']}" in place
    for text in (message["shown"]["use"], *message["shown"]["reasons"]):
        for place in (printed, estimated):
            assert text in place
    for name, k, b, held, misfit in message["shown"]["estimates"]:
        row = [name, *k.split(), *b.split(), held, misfit]
        for place in (printed, estimated):
            assert row in [line.split() for line in place.splitlines()]


def test_run_prints_the_same_result_as_estimate(path, capsys, tmp_path):
    own = tmp_path / "own.mcap"
    command = ["run", "--clock", "virtual", "--duration", "2", "--record", str(own)]
    assert main([*command, "--json"]) == 0
    of_run = json.loads(capsys.readouterr().out)
    assert main(["estimate", str(own), "--json"]) == 0
    of_estimate = json.loads(capsys.readouterr().out)
    assert of_run["result"] == of_estimate["result"]
    assert of_run["best_model"] == of_estimate["best_model"]


def test_a_trial_without_a_recording_has_the_same_result(trial):
    assert run_trial(SETTINGS).result.summary == trial.result.summary


def test_a_long_trial_has_the_result_of_the_sections_that_estimate_reads(tmp_path, capsys):
    path = tmp_path / "long.mcap"
    settings = replace(SETTINGS, duration=100.0, rate=200.0, estimators=("rls",))
    result = run_trial(settings, path).result.summary["result"]
    assert any("the record is long" in reason for reason in result["reasons"])
    assert main(["estimate", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["result"] == json.loads(dumps(result))


def test_a_trial_in_which_nothing_moved_has_no_number_and_a_reason(trial):
    ticks = trial.recording
    still = {**ticks.columns, "paired_position": np.zeros(len(ticks))}
    found = trial_result.trial_result(replace(ticks, columns=still), None)
    result = found.summary["result"]
    assert not result["identifiable"]
    assert result["k"] is None
    assert "motion is too small" in result["reasons"][0]
    assert found.picture is None
    shown = result_document(found, trial.summary()["estimates"])["shown"]
    assert shown["values"] == []
    assert shown["use"].startswith("k and b cannot be used, because the motion is too small")


def test_an_error_in_the_evaluation_is_a_sentence_and_ends_nothing(trial, monkeypatch):
    def fail(*arguments):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(trial_result, "evaluate", fail)
    (reason,) = trial_result.trial_result(trial.ticks, None).summary["result"]["reasons"]
    assert reason == f"{trial_result.FAILED}: ZeroDivisionError: a defect"


def test_the_picture_has_the_measured_points_and_k_as_their_slope(trial, message):
    drawn = message["picture"]
    depth, force = np.array(drawn["depth"]), np.array(drawn["force"])
    assert 300 < len(depth) == len(force) == len(drawn["fit"]) < 2000
    fit = np.array(drawn["fit"], float)
    known = np.isfinite(fit)
    assert known.mean() > 0.9
    assert np.abs(fit - force)[known].max() < 0.2
    at = drawn["tangent"]
    assert at["k"] == message["result"]["k"]
    near = np.abs(depth - at["depth"]) < 5e-4
    k, level = np.polyfit(depth[near] - at["depth"], force[near], 1)
    assert k == pytest.approx(at["k"], rel=0.05)
    assert level == pytest.approx(at["force"], abs=0.2)


def test_the_output_of_estimate_fits_a_terminal_of_80_x_24(path, trial, monkeypatch, capsys):
    """`test_trial_tables.py` tests that of a run."""
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["estimate", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 23  # the last line is for the next command
    assert max(map(len, lines)) <= 80
