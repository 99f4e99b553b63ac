"""The packages of the pages about conditions, signals, links and rigs work in every command."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from teleop.cli import main
from teleop.recording.recording import load

PARTS = ("condition", "signal", "link", "rig")
OPTIONS = {
    "condition": ["--condition", "acme.guarded", "--set", "limit=10N"],
    "signal": ["--condition", "autonomous", "--signal", "acme.tones", "--set", "high=4Hz"],
    "link": ["--link", "acme.variable", "--set", "slow=60"],
    "rig": ["--rig", "acme.spring", "--specimen", "spring", "--depth", "8mm"],
}
NAMES = {"condition": "acme.guarded", "signal": "acme.tones", "link": "acme.variable"}
RUN = ["run", "--clock", "virtual", "--duration", "2", "--rate", "500", "--estimators", "rls"]


def printed(capsys, *command):
    assert main([*map(str, command), "--json"]) == 0, capsys.readouterr().err
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("part", PARTS)
def test_the_test_of_each_page_passes(installed, third_party, part_pages, part):
    with installed(third_party):
        defined = {"__name__": "tests_of_the_page"}
        exec(part_pages[part].block("def test_"), defined)
        (test,) = [value for name, value in defined.items() if name.startswith("test_")]
        test()


@pytest.fixture(scope="module")
def recordings(installed, third_party, tmp_path_factory):
    """A recording of a trial with each part."""
    folder = tmp_path_factory.mktemp("parts")
    with installed(third_party):
        for part, options in OPTIONS.items():
            assert main([*RUN, *options, "--record", str(folder / f"{part}.mcap"), "--json"]) == 0
    return folder


@pytest.mark.parametrize("part", PARTS)
def test_a_part_is_recorded_and_runs_again_to_the_bit(
    installed, third_party, recordings, tmp_path, capsys, part
):
    path, again = recordings / f"{part}.mcap", tmp_path / "again.mcap"
    stated = load(path).settings[f"custom_{part}"]
    about = (f"acme-{part}", "1.0", True)
    assert (stated["distribution"], stated["version"], stated["plug_in"]) == about
    with installed(third_party):
        printed(capsys, "run", "--config", path, "--record", again)
    first, second = load(path), load(again)
    for name, column in first.columns.items():
        np.testing.assert_array_equal(second[name], column)


@pytest.mark.parametrize("part", PARTS)
def test_without_the_package_a_recording_is_evaluated_but_not_run_again(
    installed, third_party, recordings, tmp_path, capsys, part
):
    path = recordings / f"{part}.mcap"
    with installed(third_party):
        known = printed(capsys, "estimate", path)
    unknown = printed(capsys, "estimate", path)
    assert unknown == known
    assert main(["report", str(path), "--out", str(tmp_path / "report.html")]) == 0
    capsys.readouterr()
    assert main(["run", "--config", str(path), "--no-record"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert f"of acme-{part} 1.0: is not installed" in error


def test_a_series_and_a_sweep_use_the_parts(installed, third_party, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "series.toml").write_text(
        'name = "parts"\n[factors]\ncondition = ["free", "acme.guarded"]\n[settings]\n'
        'clock = "virtual"\nduration_s = 1.0\nestimators = ["rls"]\nspecimen = "spring"\n'
        'depth_m = 0.008\n[settings.custom_rig]\nname = "acme.spring"\n'
        '[settings.custom_link]\nname = "acme.variable"\n'
    )
    (tmp_path / "sweep.toml").write_text(
        'name = "limits"\n[factors]\n"custom_condition.parameters.limit" = [5.0, 50.0]\n'
        '[settings]\nduration_s = 1.0\nestimators = ["rls"]\n'
        'specimen = "spring"\ndepth_m = 0.008\n'
        '[settings.custom_condition]\nname = "acme.guarded"\n'
        '[settings.custom_rig]\nname = "acme.spring"\n'
    )
    with installed(third_party):
        assert printed(capsys, "series", "series.toml", "--out", "s")["done"] == 2
        found = printed(capsys, "sweep", "sweep.toml", "--out", "w", "--workers", "1")
    recorded = [load(path) for path in sorted((tmp_path / "s" / "recordings").glob("*.mcap"))]
    names = {(one.settings["custom_condition"] or {}).get("name") for one in recorded}
    assert names == {None, "acme.guarded"}
    assert {one.settings["custom_rig"]["name"] for one in recorded} == {"acme.spring"}
    assert found["failed"] == 0
    origins = "".join(path.read_text() for path in (tmp_path / "w").glob("*.json*"))
    assert "condition acme.guarded" in origins
    assert "rig acme.spring" in origins


@pytest.mark.real_time
def test_the_live_page_shows_a_trial_with_a_part(installed, third_party, tmp_path, capsys):
    path = tmp_path / "live.mcap"
    live = ["--live", "--yes", "--realtime", "off", "--rate", "250", "--duration", "0.6"]
    with installed(third_party):
        run = ["run", *OPTIONS["condition"], *live, "--record", str(path)]
        assert main([*run, "--json"]) in (0, 3)
    assert "live page: http" in capsys.readouterr().err
    assert load(path).settings["custom_condition"]["parameters"] == {"limit": 10.0}


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--condition", "acme.guarde"], "did you mean acme.guarded?"),
        (["--condition", "acme.guarded", "--set", "limit=5mm"], "expected a force with its unit"),
        (["--condition", "acme.guarded", "--set", "limit=-1"], "limit must be positive, got -1 N"),
        (["--condition", "acme.guarded", "--set", "x=1"], "expected one of condition.limit"),
        (["--condition", "acme.guarded", "--set", "limit"], "expected NAME=VALUE"),
        (["--set", "limit=1"], "expected a part of another package first"),
        (["--link", "acme.variable", "--set", "slow=a"], "slow: expected a number, got 'a'"),
        (["--link", "acme.variable", "--condition", "autonomous"], "not in autonomous"),
        (["--link", "acme.variable", "--feedback", "position-force"], "not with force feedback"),
        (["--signal", "acme.tones", "--condition", "mimic"], "not in mimic: expected a sine"),
        (["--signal", "acme.tones", "--frequency", "2"], "expected --set"),
        (["--rig", "acme.spring"], "expected also a specimen"),
    ],
)
def test_a_wrong_use_of_a_part_is_refused_in_one_line(
    installed, third_party, capsys, options, expected
):
    with installed(third_party):
        assert main(["run", "--clock", "virtual", "--no-record", *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert expected in error


def test_the_list_contains_parameters_and_what_cannot_be_used(
    installed, third_party, tmp_path, capsys
):
    info = tmp_path / "Broken-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: Broken\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text("[teleop.conditions]\nbroken = broken_part:X\n")
    (tmp_path / "broken_part.py").write_text("def (")
    with installed(third_party), installed(tmp_path):
        found = printed(capsys, "list")
        assert main(["list", "conditions"]) == 0
    text = capsys.readouterr().out
    assert "acme-condition 1.0" in text
    assert "--set limit=15.0 [N]: Contact force" in text
    assert "SyntaxError" in text
    assert {row["name"] for row in found["estimators"]} >= {"rls", "nlms"}
    assert "acme" in {row["name"] for row in found["devices"]}
    assert [row["name"] for row in found["rigs"]] == ["acme.spring"]
    sys.modules.pop("broken_part", None)


def test_a_configuration_with_the_name_in_the_wrong_place_is_told_the_right_one(tmp_path, capsys):
    path = tmp_path / "trial.toml"
    path.write_text('condition = "acme.guarded"\n')
    assert main(["config", "check", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "one of another package: [custom_condition] name" in error
