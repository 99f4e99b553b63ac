"""Tables of a trial."""

from __future__ import annotations

from dataclasses import replace

import pytest

from teleop.output.trial_tables import print_trial
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


@pytest.fixture(scope="module")
def trials():
    settings = TrialSettings(condition="autonomous", clock="virtual", estimators=("rls",))
    return {
        duration: replace(run_trial(replace(settings, duration=duration)), interrupted=True)
        for duration in (0.5, 2.5)
    }


def test_an_interrupted_trial_states_its_real_duration(trials, capsys):
    planned = replace(trials[2.5], settings=replace(trials[2.5].settings, duration=10.0))
    summary = planned.summary()
    assert summary["actual_duration_s"] == pytest.approx(2.5, abs=0.01)
    assert summary["contact_s"] > 1.0
    print_trial(summary)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "autonomous, soft cube, 2.50 of 10 s"
    assert "INTERRUPTED" in lines[1]
    assert any("rls" in line for line in lines)


def test_an_interrupted_trial_with_less_than_a_second_of_contact_has_no_estimates(trials, capsys):
    summary = trials[0.5].summary()
    assert summary["contact_s"] < 1.0
    assert summary["estimates"] == {}
    print_trial(summary)
    out = capsys.readouterr().out
    assert "no estimates: 0." in out
    assert "rls" not in out
    assert "rls" in replace(trials[0.5], interrupted=False).summary()["estimates"]


def test_the_true_values_are_printed_with_the_causes_of_a_low_damping(trials, capsys):
    summary = trials[2.5].summary()
    print_trial(summary)
    assert "too low" not in capsys.readouterr().out
    print_trial(summary | {"force_lag_s": 0.0, "lost_motion_m": 0.0})
    out = " ".join(capsys.readouterr().out.split())
    truth = summary["truth"]
    assert f"true values of the simulated rig: b {truth['b']:.3g} N s/m" in out
    assert "lag of the force channel 2.66 ms; lost motion of the slave 122 um." in out
    assert "Not corrected for lag and lost motion, the estimate of b is too low." in out
