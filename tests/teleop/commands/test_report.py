"""`teleop report`."""

from __future__ import annotations

import json
import re
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.cli import main
from teleop.control.excitation_signals import Sine
from teleop.output.report_page import value_text
from teleop.output.report_result import values_of
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
    assert page.count("<figure") == page.count("<svg") == 5
    assert "measured</text>" in page


def test_the_page_begins_with_the_result_and_ends_with_versions(trial, page):
    assert re.sub("<.*?>", " ", page.split("<body>")[1]).split()[:4] == [
        *("a", "trial.mcap", "condition", "autonomous")
    ]
    places = [
        page.index(text)
        for text in ("stiffness k", "damping b", "Online estimators", "Settings<", "libraries")
    ]
    assert places == sorted(places)
    assert places[1] < page.index("<svg")


def cards(page):
    """Return the texts in the card of each value of the result, by its name."""
    sections = re.findall(r'<section class="value">(.*?)</section>', page, re.DOTALL)
    texts = [[*filter(None, map(str.strip, re.split("<.*?>", one)))] for one in sections]
    return {name: rest for name, *rest in texts}


def test_the_numbers_are_those_of_estimate_and_the_true_values_stand_beside_them(
    trial, page, capsys
):
    capsys.readouterr()
    assert main(["estimate", str(trial), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    shown = cards(page)
    assert [*shown] == ["stiffness k", "stiffness k at the tip", "damping b"]
    for texts, end in zip(shown.values(), ("k", "k_tip", "b"), strict=True):
        mark, value, interval, true = texts
        assert mark == "● can be used"
        result = document["result"]
        if end == "k_tip":
            low, exact, high = (result[end][name] for name in ("low", "value", "high"))
        else:
            low, exact, high = result[f"{end}_low"], result[end], result[f"{end}_high"]
        resolution = 0.1 * (high - low)
        numbers = [float(one) for one in re.findall(r"-?[\d.]+", f"{value} {interval}")]
        assert numbers[0] == pytest.approx(exact, abs=resolution)
        assert numbers[2:] == pytest.approx([low, high], abs=resolution)
        assert float(true.split()[2]) == pytest.approx(exact, rel=0.02)
    for name, row in document["estimates"].items():
        (cells,) = re.findall(rf"<td>{name}</td>\s*<td>(\S+) .*?</td>\s*<td>(\S+) .*?</td>", page)
        for text, part in zip(cells, ("k", "b"), strict=True):
            assert float(text) == pytest.approx(
                row[f"{part}_end"], abs=0.1 * row[f"{part}_interval"]
            )


def test_a_misfit_above_five_percent_is_marked(trial, page, capsys):
    capsys.readouterr()
    assert main(["estimate", str(trial), "--json"]) == 0
    estimates = json.loads(capsys.readouterr().out)["estimates"]
    misfits = {name for name, row in estimates.items() if row["misfit"] > 0.05}
    assert misfits
    rows = re.findall(r'<tr class="unsupported">\s*<td>(\w+)</td>', page)
    assert set(rows) == misfits
    assert page.count('<td class="high">') == len(misfits)


def test_a_file_without_contact_has_no_k_and_b_and_no_true_values(tmp_path, without_drawings):
    t = np.arange(0.0, 6.0, 2e-3)
    noise = np.random.default_rng(0).normal(0.0, 0.02, t.size)
    table = np.column_stack((t, 4.0 - 3.0 * np.cos(4.0 * t), noise))
    file = tmp_path / "free.csv"
    np.savetxt(file, table, delimiter=",", header="Time [s],Position [mm],Force [N]", comments="")
    assert main(["report", str(file)]) == 0
    shown = cards(file.with_suffix(".html").read_text())
    why = "the force does not follow the displacement: no contact"
    assert shown == {
        "stiffness k": ["✕ cannot be used", "not determined", why],
        "damping b": ["✕ cannot be used", "not determined"],
    }


def test_a_damping_that_cannot_be_used_has_its_reason():
    result = {"k": 900.0, "k_low": 890.0, "k_high": 910.0, "b": 0.2, "b_low": -1.0, "b_high": 1.4}
    k, b = values_of(result | {"k_tip": None, "reasons": ["a remark"]} | USABLE_K, None)
    assert (k.usable, k.reason) == (True, "")
    assert (b.usable, b.reason) == (False, "its interval contains zero")


USABLE_K = {"identifiable": True, "b_reason": "its interval contains zero"}
COLOURS = re.compile(r"--([\w-]+): (#[0-9a-f]{6});")


def test_the_colours_are_those_of_the_live_page(page):
    live = files("teleop.live").joinpath("page/page.css").read_text()
    (bright, dark), (live_bright, live_dark) = (
        [dict(COLOURS.findall(part)) for part in text.split("prefers-color-scheme: dark")[:2]]
        for text in (page.split("</style>")[0], live)
    )
    assert len(bright) > len(dark) > 10
    assert bright.items() <= live_bright.items()
    assert dark.items() <= live_dark.items()


def test_the_figures_have_the_colours_of_the_page(page):
    drawings = re.findall("<svg.*?</svg>", page, re.DOTALL)
    used = set(re.findall(r"var\(--([\w-]+)\)", "".join(drawings)))
    assert {"panel", "e0", "e1", "muted"} <= used <= dict(COLOURS.findall(page)).keys()
    assert "#ffffff" not in "".join(drawings)


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
    for start, tag in (("k is the tangent stiffness at", "li"), ("motion: ", "p")):
        (line,) = [line.strip() for line in out.splitlines() if line.strip().startswith(start)]
        assert f"<{tag}>{line}</{tag}>" in page


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
    (table,) = re.findall(r"Safety events</summary>(.*?)</table>", page, re.DOTALL)
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
    assert '<td>signal</td><td class="left">sine of 2 Hz</td>' in page
    assert re.search(r'<td>depth</td><td class="left">\S+ mm</td>', page)


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
