"""The figure of the force at the hand beside that at the slave, and its place in the report."""

from __future__ import annotations

import pytest

from sim_backend import OperatorModel
from teleop.control.feedback.settings import FeedbackSettings
from teleop.evaluation.teleoperation.rendering import hand
from teleop.output.report_page import report_page
from teleop.output.trial_figures import feedback_figure
from teleop.recording.recording import load
from teleop.safety.events import ACTIVE
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("feedback") / "trial.mcap"
    run_trial(
        TrialSettings(
            clock="virtual",
            duration=3.0,
            estimators=("rls",),
            feedback=FeedbackSettings("model-mediated"),
            operator_model=OperatorModel(aim_force=10.0),
        ),
        path,
    )
    return path


def test_both_panels_have_the_same_force_axis_and_the_recorded_curves(recorded):
    recording = load(recorded)
    left, right = feedback_figure(recording).axes
    assert left.get_ylim() == right.get_ylim()
    active = recording.where(recording["mode"] == ACTIVE)
    x, f = right.lines[0].get_data()
    assert set(x) <= set(active["slave_position"] * 1e3)
    assert set(f) <= set(active["contact_force"])
    assert len(left.lines[0].get_xdata()) > 100


def test_the_felt_force_is_the_displayed_force(recorded):
    recording = load(recorded)
    active = recording.where(recording["mode"] == ACTIVE)
    felt = hand(active, 0.5, 15.0, 0.0).force
    shown = active["displayed_force"]
    difference = (felt - shown)[10:]
    assert abs(difference).mean() < 0.02 * abs(shown[1:]).max()


def test_the_report_has_the_figure_only_with_force_feedback(recorded, tmp_path):
    with_feedback = report_page("trial.mcap", None, None, load(recorded))
    assert "<summary>Force feedback</summary>" in with_feedback
    assert with_feedback.count("<svg") == 1
    plain = tmp_path / "plain.mcap"
    run_trial(TrialSettings(clock="virtual", duration=1.0, estimators=("rls",)), plain)
    without = report_page("plain.mcap", None, None, load(plain))
    assert "<summary>Force feedback</summary>" not in without
    assert "<svg" not in without
