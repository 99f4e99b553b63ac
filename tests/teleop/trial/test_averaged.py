"""The part of a trial over which the estimates are averaged."""

from __future__ import annotations

import functools
import json
from dataclasses import replace

import numpy as np
import pytest

from teleop.cli import main
from teleop.evaluation.settings import WHOLE
from teleop.output.trial_tables import print_trial
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import averaged_part, recorded_part
from teleop.trial.run import run_trial

SETTINGS = TrialSettings(clock="virtual", duration=5.0, estimators=("rls", "me"))


@pytest.fixture(scope="module")
def trial_of(tmp_path_factory):
    """Return a function: a recorded trial of a condition with a count-in of 1 s."""

    @functools.cache
    def run(condition):
        path = tmp_path_factory.mktemp("averaged") / "a.mcap"
        return run_trial(replace(SETTINGS, condition=condition, count_in=1.0), path)

    return run


@pytest.fixture(scope="module")
def ended_in_count_in(tmp_path_factory):
    path = tmp_path_factory.mktemp("count-in") / "a.mcap"
    return run_trial(replace(SETTINGS, condition="mimic", count_in=3.0, duration=1.0), path)


def averages(trial, first, last):
    """Return the average and the last stiffness of RLS between two times, from the recording."""
    part = (first <= trial.t) & (trial.t < last)
    k = trial.estimates["rls"].k[part]
    known = ~np.logical_and.accumulate(trial.estimates["rls"].held[part])
    return k[known].mean(), k[-1]


def test_the_estimates_of_an_autonomous_trial_end_before_the_excitation_ramps_to_zero(trial_of):
    trial = trial_of("autonomous")
    row = trial.summary()["estimates"]["rls"]
    assert (row["k"], row["k_end"]) == pytest.approx(averages(trial, -1.0, 4.5), rel=1e-12)
    assert row["k_end"] != trial.estimates["rls"].k[-1]


def test_the_averages_of_a_mimic_trial_leave_out_the_count_in(trial_of):
    trial = trial_of("mimic")
    summary = trial.summary()
    row = summary["estimates"]["rls"]
    assert (row["k"], row["k_end"]) == pytest.approx(averages(trial, 1.0, 9.0), rel=1e-12)
    assert summary["expected_intervals"]["b"] == trial.columns["b_bound"][-1]
    assert summary["pairs"] == len(trial.t)


@pytest.mark.parametrize("changes", [{"condition": "free"}, {"condition": "mimic"}])
def test_trials_without_count_in_and_ramp_are_averaged_as_a_whole(changes):
    trial = run_trial(replace(SETTINGS, duration=1.0, **changes))
    assert averaged_part(trial.recording, trial.settings) == WHOLE
    assert trial.summary()["left_out"] == ""


def test_the_part_begins_when_the_drives_are_armed(trial_of):
    trial = trial_of("autonomous")
    late = replace(trial.recording, events=[{"mode": "active", "time": 0.25}])
    assert averaged_part(late, trial.settings)[:2] == (-np.inf, 4.75)


def test_a_trial_that_ended_in_the_count_in_has_no_estimates(ended_in_count_in, capsys):
    trial = replace(ended_in_count_in, interrupted=True)
    summary = trial.summary()
    assert summary["estimates"] == {}
    assert summary["actual_duration_s"] == pytest.approx(1.0, abs=0.01)
    print_trial({**summary, **trial.result.summary}, details=False)
    out = capsys.readouterr().out
    assert "no estimates: 0.00 s of contact" in out
    assert "k and b cannot be used, because" in out


def test_the_result_of_a_mimic_trial_leaves_out_the_count_in(trial_of, capsys):
    trial = trial_of("mimic")
    assert main(["estimate", str(trial.outcome.path), "--json"]) == 0
    evaluated = json.loads(capsys.readouterr().out)
    assert min(phase["from_s"] for phase in evaluated["phases"]) >= 1.0
    assert evaluated["motion"]["frequency_hz"] > 0.9
    assert evaluated["as_online"]
    assert evaluated["samples_used"] > 4900


def test_a_recording_that_ends_in_the_count_in_is_refused(ended_in_count_in, capsys):
    assert main(["estimate", str(ended_in_count_in.outcome.path)]) == 2
    assert "only 0 samples without the count-in of 3 s" in capsys.readouterr().err


def test_settings_that_are_not_valid_average_the_whole_recording():
    trial = run_trial(replace(SETTINGS, condition="autonomous", duration=1.0))
    broken = replace(trial.recording, settings=trial.recording.settings | {"condition": "none"})
    assert recorded_part(trial.recording).end == pytest.approx(0.5, abs=0.01)
    assert recorded_part(broken) == WHOLE


@pytest.mark.parametrize("condition", ["mimic", "autonomous"])
def test_the_evaluation_of_a_recording_averages_the_same_part_as_the_trial(
    condition, trial_of, capsys
):
    trial = trial_of(condition)
    path, summary = trial.outcome.path, trial.summary()
    assert main(["estimate", str(path), "--json"]) == 0
    evaluated = json.loads(capsys.readouterr().out)
    assert evaluated["left_out"] == summary["left_out"] != ""
    for name, row in summary["estimates"].items():
        again = evaluated["estimates"][name]
        for key in ("k", "b", "k_end", "e_f", "one_step_rms", "held"):
            assert again[key] == pytest.approx(row[key], rel=1e-9), (name, key)
    assert main(["estimate", str(path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert f"left out: {summary['left_out']}" in text
