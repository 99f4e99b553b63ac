"""The figure of the force at the hand beside that at the slave, and its place in the report."""

from __future__ import annotations

import numpy as np
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
from teleop.trial.trial_statistics import recorded_rendering


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


def test_the_panels_have_the_same_force_axis_and_the_recorded_curves(recorded):
    recording = load(recorded)
    left, middle, right = feedback_figure(recorded_rendering(recording)).axes
    assert left.get_ylim() == middle.get_ylim()
    x, f = middle.lines[0].get_data()
    contact = recording["contact_force"]
    assert contact.min() <= min(f) <= max(f) <= contact.max()
    # the tip is behind the encoder by the lost motion and the stretch
    assert 0.05 < recording["slave_position"].max() * 1e3 - max(x) < 0.3
    tissue, felt = (line.get_data() for line in left.lines)
    assert len(felt[0]) > 100
    assert np.interp(max(x), *tissue) == pytest.approx(max(f), rel=0.1)
    assert right.get_xscale() == "log"


def test_the_felt_force_is_the_displayed_force(recorded):
    recording = load(recorded)
    active = recording.where(recording["mode"] == ACTIVE)
    felt = hand(active, 0.5, 15.0, 0.0).force
    shown = active["displayed_force"]
    difference = (felt - shown)[10:]
    assert abs(difference).mean() < 0.02 * abs(shown[1:]).max()


def test_the_report_has_the_figure_only_with_force_feedback(recorded, tmp_path):
    felt = recorded_rendering(load(recorded))
    shown = {"felt": felt, "felt_texts": ["the hand felt k = 1 N/m"]}
    with_feedback = report_page("trial.mcap", None, None, load(recorded), **shown)
    assert "<summary>Force feedback</summary>" in with_feedback
    assert with_feedback.count("<svg") == 1
    assert "the hand felt k = " in with_feedback
    plain = tmp_path / "plain.mcap"
    run_trial(TrialSettings(clock="virtual", duration=1.0, estimators=("rls",)), plain)
    assert recorded_rendering(load(plain)) is None
    without = report_page("plain.mcap", None, None, load(plain))
    assert "<summary>Force feedback</summary>" not in without
    assert "<svg" not in without
