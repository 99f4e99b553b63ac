"""The result of a trial as figures, table and text, for a notebook."""

from __future__ import annotations

import re

import numpy as np
import pytest

from estimation.figure_style import PURPLE
from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.teleoperation.tracking import tracking
from teleop.output.result_tables import result_values
from teleop.output.trial_figures import tracking_figure
from teleop.output.web_page import svg
from teleop.recording.recording import Recording, load
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("mimic") / "mimic.mcap"
    settings = TrialSettings("mimic", duration=3.0, clock="virtual", estimators=("rls", "kalman"))
    return run_trial(settings, path), path


@pytest.fixture
def mimic(recorded):
    return recorded[0]


def test_the_figure_of_a_trial_names_it_and_has_the_true_values(mimic):
    figure = mimic.plot("double")
    assert figure.get_figwidth() == 7.16
    title, *_, remark = figure.axes[0].get_title(loc="left").split("\n")
    assert title == "mimic, soft cube"
    assert remark.startswith("misfit above 5%, estimates cannot be used: rls")
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names[:2] == ["rls", "kalman"]
    assert "true values (k: secants)" in names


def test_the_figure_of_a_trial_has_the_result_that_is_printed(mimic):
    stiffness, damping, *_ = mimic.plot().axes
    found = mimic.result.summary["result"]
    levels = {
        axes: {line.get_ydata()[0] for line in axes.get_lines() if line.get_color() == PURPLE}
        for axes in (stiffness, damping)
    }
    assert levels == {stiffness: {found["k"] / 1e3}, damping: {found["b"]}}
    title = stiffness.get_title(loc="left")
    for one in result_values(found):
        shown = f"{one.symbol} = {one.value} {one.unit} (95 % interval {one.low} to {one.high})"
        assert (shown in title) == (one.symbol != "k at the tip")


def test_the_figure_of_a_trial_without_a_result_states_why():
    settings = TrialSettings("autonomous", duration=0.02, clock="virtual", estimators=("rls",))
    short = run_trial(settings)
    (reason, *_) = short.result.summary["result"]["reasons"]
    stiffness = short.plot().axes[0]
    assert f"no k and b: {reason}" in stiffness.get_title(loc="left").replace("\n", " ")
    assert not [line for line in stiffness.get_lines() if line.get_color() == PURPLE]


def test_the_figure_of_the_force_names_the_trial(mimic):
    assert mimic.plot_force().axes[0].get_title(loc="left") == "mimic, soft cube"


def test_the_figure_of_the_tracking_has_target_position_and_error_and_states_gain_and_phase(mimic):
    position, error = mimic.plot_tracking().axes
    drawn = {line.get_label(): line for line in position.get_lines()}
    assert drawn.keys() == {"slave", "target"}
    t, target = drawn["target"].get_data()
    assert target.min() == pytest.approx(1.55, rel=1e-3)
    assert target.max() == pytest.approx(15.5, rel=1e-3)
    own = drawn["slave"].get_data()
    error_t, difference = error.get_lines()[0].get_data()
    expected = np.interp(error_t, *own) - np.interp(error_t, t, target)
    assert np.allclose(difference, expected, atol=0.05)
    found, title = mimic.tracking(), position.get_title(loc="left")
    assert f"gain {found['gain']:.2f}, phase {found['phase_deg']:.0f} deg" in title
    assert f"{found['rms_m'] * 1e3:.2f} mm rms" in title


def test_another_condition_has_no_figure_of_the_tracking(tmp_path, refused):
    trial = run_trial(TrialSettings(duration=0.5, clock="virtual"))
    with pytest.raises(InputError, match="no tracking in a trial of free"):
        trial.plot_tracking()
    line = refused("run", "--clock", "virtual", "--plot-tracking", tmp_path / "x.png")
    assert "--plot-tracking: expected --condition mimic" in line


def test_run_writes_the_figure_of_the_tracking(tmp_path):
    path = tmp_path / "tracking.svg"
    options = ["--condition", "mimic", "--clock", "virtual", "--duration", "3", "--no-record"]
    assert main(["run", *options, "--plot-tracking", str(path)]) == 0
    assert "target</text>" in path.read_text()


def test_the_report_of_a_mimic_trial_has_its_tracking(recorded):
    trial, path = recorded
    assert main(["report", str(path)]) == 0
    page = path.with_suffix(".html").read_text()
    assert "Tracking of the target" in page
    assert f"gain {trial.tracking()['gain']:.2f}, phase" in page
    assert "target</text>" in page


def test_the_table_of_a_trial_has_a_row_for_each_tick_of_the_estimators(mimic):
    frame = mimic.to_dataframe()
    assert frame.index.name == "time"
    assert np.array_equal(frame.index, mimic.t)
    assert np.array_equal(frame["rls_k"], mimic.estimates["rls"].k)
    assert np.array_equal(frame["contact_force"], mimic.columns["contact_force"])


def test_the_table_of_a_recording_has_a_row_for_each_tick(recorded):
    recording = load(recorded[1])
    frame = recording.to_dataframe()
    assert len(frame) == len(recording)
    assert np.array_equal(frame["target"], recording["target"], equal_nan=True)


def test_texts_are_one_short_line(recorded):
    trial, path = recorded
    k = trial.estimates["rls"].k[-1]
    text = repr(trial)
    assert text.startswith("Trial(mimic, soft cube, 3 s; rls k = ")
    assert float(re.search(r"rls k = (\S+)", text)[1]) == pytest.approx(k, rel=0.01)
    assert "estimators rls, kalman; simulated" in repr(load(path))
    for one in (text, repr(load(path))):
        assert "\n" not in one
        assert len(one) < 200


def test_the_drawing_of_the_tracking_of_ten_minutes_is_small():
    t = np.arange(0.0, 600.0, 2e-3)
    target = 5e-3 - 4e-3 * np.cos(2 * np.pi * t)
    position = np.roll(target, 40)
    columns = {"time": t, "target": target, "slave_position": position}
    found = tracking(t, target, position, 1.0)._asdict()
    assert len(svg(tracking_figure("", Recording(columns, {}), found))) < 200_000
