"""`teleop report`."""

from __future__ import annotations

import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.cli import main
from teleop.control.excitation_signals import Sine
from teleop.output.report_page import value_text
from teleop.recording.recording import load
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.recorded_trial import performed

from ..html_page import Page


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "a trial.mcap"
    arguments = ["--condition", "autonomous", "--cube", "medium", "--duration", "1.5"]
    assert main(["run", "--clock", "virtual", *arguments, "--record", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def page(trial):
    """The text of the page that the command writes beside the recording."""
    assert main(["report", str(trial)]) == 0
    return trial.with_suffix(".html").read_text()


@pytest.fixture
def without_drawings(monkeypatch):
    """Leave out the drawings of a page, which need most of its processor time."""
    monkeypatch.setattr("teleop.output.report_page.svg", lambda figure: "")


def test_the_page_needs_nothing_else_and_links_to_the_recording_only(page):
    links = Page(page).links
    assert {link for link in links if not link.startswith("#")} == {"a%20trial.mcap"}


def test_the_page_has_what_was_run_the_result_the_figures_events_and_all_settings(trial, page):
    recording = load(trial)
    for text in (
        recording.session["created"],
        recording.session["software"],
        recording.session["libraries"],
        "autonomous",
        '<td class="left">1.5 s</td>',
        "medium",
        "force lag",
        "bandwidth 20 Hz",
        "Safety events",
        "palpating" if any("palpating" in e["text"] for e in recording.events) else "ready",
        "limits.channels.contact_force.max_rate",
        "setup.cube.k1",
    ):
        assert text in page
    assert page.index("stiffness k =") < page.index("Online estimators")
    assert page.count("<figure") == page.count("<svg") == 4
    assert "measured</text>" in page


def test_estimators_and_model_are_chosen_and_json_has_the_results(
    trial, tmp_path, capsys, without_drawings
):
    out = tmp_path / "page.html"
    options = ["--estimators", "kalman", "--model", "stiffening", "--json", "--out", str(out)]
    assert main(["report", str(trial), *options]) == 0
    page, document = out.read_text(), json.loads(capsys.readouterr().out)
    assert [*document["estimates"]] == ["kalman"]
    assert document["estimates"]["kalman"]["further"].keys() == {"k3"}
    assert document["software"].startswith("teleop ")
    assert re.search(r"kalman at the end: k3 \S+ ± \S+ N/m\^3", page)
    assert "<td>rls</td>" not in page


def test_the_page_states_the_force_at_which_the_stiffness_holds_as_the_terminal_does(
    trial, page, capsys
):
    capsys.readouterr()
    assert main(["estimate", str(trial), "--details"]) == 0
    out = capsys.readouterr().out
    for start in ("k is the tangent stiffness at", "motion: "):
        (line,) = [line.strip() for line in out.splitlines() if line.strip().startswith(start)]
        assert f"<p>{line}</p>" in page


def test_a_page_in_another_folder_is_named_and_links_to_the_recording(
    trial, tmp_path, capsys, without_drawings
):
    page = tmp_path / "page.html"
    capsys.readouterr()
    assert main(["report", str(trial), "--out", str(page)]) == 0
    assert capsys.readouterr().out.strip() == str(page)
    (link,) = re.findall(r'<a href="([^"]+)"', page.read_text())
    assert (tmp_path / link.replace("%20", " ")).resolve() == trial.resolve()


def test_the_times_of_the_safety_events_increase(trial, page):
    (table,) = re.findall(r"Safety events</h2>(.*?)</table>", page, re.DOTALL)
    times = re.findall(r"<td>(.*?)</td>", table)
    assert "-0.000" not in times
    assert len(times) == len(load(trial).events) - 1, "the beginning of the recording has no time"
    assert [float(time) for time in times] == sorted(float(time) for time in times)


def test_the_settings_have_rounded_values_with_units_and_the_defaults_in_effect(page):
    table = page.split("Settings<")[1]
    settings = dict(re.findall(r'<tr><td>(.*?)</td><td class="left">(.*?)</td></tr>', table))
    assert not {"", "None", "False", "True", "Infinity"} & set(settings.values())
    assert settings["loop_rate_hz"] == "1000 Hz"
    assert settings["limits.hard_force"].endswith(" N")
    assert settings["estimators"] == "rls, ai, me"
    fractions = re.findall(r"\d+\.\d+", str(settings))
    assert all(len(re.sub(r"\D", "", one).lstrip("0")) <= 5 for one in fractions)
    assert '<th>signal</th><td class="left">sine of 2 Hz</td>' in page
    assert re.search(r'<th>depth</th><td class="left">\S+ mm</td>', page)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_value_is_rounded_to_five_digits(value):
    assert float(value_text(value)) == pytest.approx(value, rel=1e-4)


def test_a_report_of_mimic_states_the_target():
    settings = TrialSettings("mimic", signal=Sine(0.8), depth=5e-3, count_in=3.0)
    assert performed(settings) == {
        "depth": "5 mm",
        "target": "sine of 0.8 Hz, from 0.5 to 5 mm",
        "count-in": "3 s",
    }
