"""`teleop run --protocol`: what is recorded, and the results of the steps."""

from __future__ import annotations

import json

import numpy as np
import pytest

from teleop.cli import main
from teleop.recording.recording import load
from teleop.settings.protocol_files import included, load_protocol

PROTOCOL = """
description = "a hold and two sines"
[[phases]]
kind = "approach"
[[phases]]
kind = "ramp-hold-release"
depth = 0.002
ramp = 0.1
hold = 3.0
[[phases]]
kind = "cyclic"
depth = 0.002
amplitude = 0.0005
frequencies = [2.0, 5.0]
cycles = 5
"""
BODY = """
protocol = "test.toml"
clock = "virtual"
estimators = ["rls"]
rate_hz = 500.0
lost_motion_m = 0.0
[custom_setup]
force_lag = 2.66e-3
depth = 4e-3
[custom_setup.cube]
k = 900.0
tau = 0.5
body = {k1 = 2000.0, k3 = 0.0, b = 3.0, glued = false}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a recording of a protocol on a body that relaxes in 0.5 s."""
    made = tmp_path_factory.mktemp("protocol")
    (made / "test.toml").write_text(PROTOCOL)
    (made / "body.toml").write_text(BODY)
    run = ["run", "--config", str(made / "body.toml"), "--record", str(made / "a.mcap")]
    assert main([*run, "--seed", "40971", "--json"]) == 0
    return made


def printed(capsys, *command):
    assert main([*map(str, command)]) == 0, capsys.readouterr().err
    return capsys.readouterr().out


def test_the_relaxation_time_of_the_body_is_found(folder, capsys):
    document = json.loads(printed(capsys, "estimate", folder / "a.mcap", "--json"))
    (hold,) = [one for one in document["steps"] if one["kind"] == "relaxation"]
    (part,) = hold["relaxation"]["parts"]
    assert part["low"] <= 0.5 <= part["high"]
    assert part["high"] - part["low"] < 0.1


def test_the_storage_stiffness_of_each_frequency_is_that_of_the_body(folder, capsys):
    document = json.loads(printed(capsys, "estimate", folder / "a.mcap", "--json"))
    sines = [one["dynamic"] for one in document["steps"] if one["kind"] == "cyclic"]
    assert [one["frequency"] for one in sines] == [2.0, 5.0]
    for one in sines:
        omega = 2.0j * np.pi * one["frequency"]
        body = 2000.0 + 900.0 * 0.5 * omega / (1.0 + 0.5 * omega) + 3.0 * omega
        assert one["storage"] == pytest.approx(body.real, rel=0.02)
        assert one["loss"] is None, "the lag of the force is not known"
        assert "each millisecond" in one["reason"]


def test_a_table_and_a_report_show_the_steps(folder, capsys):
    text = printed(capsys, "estimate", folder / "a.mcap")
    assert "relaxation at" in text
    assert "k' [N/m]" in text
    printed(capsys, "report", folder / "a.mcap")
    page = (folder / "a.html").read_text()
    assert "Steps of the protocol" in page
    assert "condition protocol" in page


def test_the_steps_are_recorded_and_the_protocol_runs_again_to_the_bit(folder, capsys):
    again = folder / "again.mcap"
    printed(capsys, "run", "--config", folder / "a.mcap", "--record", again, "--json")
    first, second = load(folder / "a.mcap"), load(again)
    np.testing.assert_array_equal(first["slave_position"], second["slave_position"])
    numbers = first["phase"][np.isfinite(first["phase"])]
    assert numbers.min() == 0.0
    assert np.all(np.diff(numbers) >= 0.0)


def test_the_whole_record_gets_no_reason_that_belongs_to_a_palpation(folder, capsys):
    result = json.loads(printed(capsys, "estimate", folder / "a.mcap", "--json"))["result"]
    assert result["identifiable"] or result["reasons"] == [
        "the whole record of this protocol has no single k and b: see its steps"
    ]


@pytest.mark.parametrize("name", included())
def test_the_included_protocols_can_be_read(name):
    protocol = load_protocol(name)
    assert protocol.description
    assert 30.0 < protocol.longest < 200.0


@pytest.mark.parametrize(
    ("text", "options", "expected"),
    [
        ("", [], "phases: is missing"),
        ("phases = []", [], "phases: expected at least one"),
        ('[[phases]]\nkind = "hld"', [], "kind 'hld': expected one of approach, ramp"),
        ('[[phases]]\nkind = "hold"\ncolour = 1', [], "phases.0.hold.colour: unknown setting"),
        ('[[phases]]\nkind = "preload"\ndepth = 0.05', [], "depth 50 mm: expected at most"),
        ('[[phases]]\nkind = "preload"\nforce = 500.0', [], "force 500 N: expected at most"),
        ('[[phases]]\nkind = "hold"', ["--duration", "5"], "expected at least 10 s"),
        ('[[phases]]\nkind = "hold"', ["--condition", "free"], "--protocol and --condition"),
        ('[[phases]]\nkind = "cyclic"\ndepth = 0.001\nfrequencies = [80.0]', [], "at most a twent"),
    ],
)
def test_an_invalid_protocol_is_refused_in_one_line(tmp_path, capsys, text, options, expected):
    path = tmp_path / "p.toml"
    path.write_text(text)
    run = ["run", "--protocol", str(path), "--clock", "virtual", "--no-record", *options]
    assert main(run) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert expected in error
