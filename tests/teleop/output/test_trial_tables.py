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
    print_trial({**summary, **planned.result.summary}, details=False)
    lines = capsys.readouterr().out.splitlines()
    assert "INTERRUPTED" in lines[0]
    assert lines[1] == "autonomous, soft cube, 2.50 of 10 s: k and b can be used"
    assert any("rls" in line for line in lines)


def test_an_interrupted_trial_with_less_than_a_second_of_contact_has_no_estimates(trials, capsys):
    summary = trials[0.5].summary()
    assert summary["contact_s"] < 1.0
    assert summary["estimates"] == {}
    print_trial({**summary, **trials[0.5].result.summary}, details=False)
    out = capsys.readouterr().out
    assert "no estimates: 0." in out
    assert "rls" not in out
    assert "rls" in replace(trials[0.5], interrupted=False).summary()["estimates"]


def test_the_true_values_are_printed_and_in_detail_the_causes_of_a_low_damping(trials, capsys):
    summary = {**trials[2.5].summary(), **trials[2.5].result.summary}
    values = "lag of the force channel 2.66 ms; lost motion of the slave 122 um"
    causes = "the online estimates are not corrected for lag and lost motion: their b is too low"
    for details in (False, True):
        for corrected in (False, True):
            other = {} if corrected else {"force_lag_s": 0.0, "lost_motion_m": 0.0}
            print_trial(summary | other, details)
            out = " ".join(capsys.readouterr().out.split())
            assert f"true b {summary['truth']['b']:.3g} N s/m" in out
            assert (values in out) is details
            assert (causes in out) is (details and not corrected)
