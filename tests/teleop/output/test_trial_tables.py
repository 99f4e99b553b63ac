"""Tables of a trial."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from teleop.output.report_result import values_of
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


def printable(trial):
    """Return what `teleop run` prints, as text or as JSON."""
    return {**trial.summary(), **trial.result.summary, "true_result": trial.result.true}


def test_an_interrupted_trial_states_its_real_duration(trials, capsys):
    planned = replace(trials[2.5], settings=replace(trials[2.5].settings, duration=10.0))
    summary = planned.summary()
    assert summary["actual_duration_s"] == pytest.approx(2.5, abs=0.01)
    assert summary["contact_s"] > 1.0
    print_trial(printable(planned), details=False)
    lines = capsys.readouterr().out.splitlines()
    assert "INTERRUPTED" in lines[0]
    assert lines[1] == "autonomous, soft cube, 2.50 of 10 s: k and b can be used"
    assert any("rls" in line for line in lines)


def test_an_interrupted_trial_with_less_than_a_second_of_contact_has_no_estimates(trials, capsys):
    summary = trials[0.5].summary()
    assert summary["contact_s"] < 1.0
    assert summary["estimates"] == {}
    print_trial(printable(trials[0.5]), details=False)
    out = capsys.readouterr().out
    assert "no estimates: 0." in out
    assert "rls" not in out
    assert "rls" in replace(trials[0.5], interrupted=False).summary()["estimates"]


@pytest.mark.parametrize(
    ("condition", "cube"), [("free", "soft"), ("mimic", "hard"), ("autonomous", "medium")]
)
def test_the_usual_text_of_a_trial_fits_a_terminal_of_24_lines_with_80_characters(
    condition, cube, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "80")
    trial = run_trial(TrialSettings(condition, cube=cube, duration=6.0, clock="virtual"))
    path = f"recordings/2026-11-25/123456-{condition}-{cube}.mcap"
    summary = printable(trial)
    summary["recording"]["path"] = path
    print_trial(summary, details=False)
    lines = capsys.readouterr().out.splitlines()
    assert path in lines[-1] + lines[-2]
    assert len(lines) < 24  # the last line of the terminal is the prompt
    assert max(map(len, lines)) <= 80


def test_the_true_values_of_the_result_are_those_of_the_report_and_near_the_result(trials, capsys):
    summary = printable(trials[2.5])
    print_trial(summary, details=False)
    out = capsys.readouterr().out
    (line,) = [one for one in out.splitlines() if "true" in one]
    k, k_tip, b, b_tip = map(float, re.findall(r"[0-9.]+", line))
    result = summary["result"]
    assert k == pytest.approx(result["k"], rel=0.01)
    assert k_tip == pytest.approx(result["k_tip"]["value"], rel=0.01)
    assert b == pytest.approx(result["b"], rel=0.1)
    reported = values_of(result, summary["true_result"])
    assert [one.true for one in reported] == [
        f"{k} N/m",
        f"{k_tip} N/m",
        f"{b} N s/m ({b_tip} at the tip)",
    ]


def test_without_true_values_of_the_result_those_of_the_specimen_are_printed(trials, capsys):
    print_trial({**printable(trials[2.5]), "true_result": None}, details=False)
    assert "true b 3.09 N s/m; secant k 2034 N/m at the surface" in capsys.readouterr().out


def test_in_detail_the_causes_of_a_low_damping_are_printed(trials, capsys):
    summary = printable(trials[2.5])
    values = "lag of the force channel 2.66 ms; lost motion of the slave 122 um"
    causes = "the online estimates are not corrected for lag and lost motion: their b is too low"
    for details in (False, True):
        for corrected in (False, True):
            other = {} if corrected else {"force_lag_s": 0.0, "lost_motion_m": 0.0}
            print_trial(summary | other, details)
            out = " ".join(capsys.readouterr().out.split())
            assert (values in out) is details
            assert (causes in out) is (details and not corrected)
