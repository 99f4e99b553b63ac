"""Configuration files."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from drivers.rig_file import read_rig_file
from estimation import MODELS
from estimation.method_settings import OwnSettings
from teleop.cli import main
from teleop.control.tare import Tare, write_tare
from teleop.errors import InputError
from teleop.recording.recording import load
from teleop.settings.configuration import (
    read_configuration,
    write_configuration,
)
from teleop.settings.documents import from_document, to_document
from teleop.settings.trial_settings import KEYS, TrialSettings, schema
from teleop.trial.run import run_trial

SHORT = ["--clock", "virtual", "--duration", "0.3"]
RIG = Path(__file__).parents[3] / "rigs" / "serial-board.toml"


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "trial.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_key_that_is_left_out_keeps_its_default(written):
    assert read_configuration(written("seed = 3")) == TrialSettings(seed=3)


def test_a_rig_and_a_tare_are_files_beside_the_configuration(written, tmp_path):
    (tmp_path / "rig.toml").write_text(RIG.read_text())
    tare = Tare(contact_force=0.5, rig=read_rig_file(RIG).sections.name)
    write_tare(tare, tmp_path / "tare.json")
    settings = read_configuration(written('rig = "rig.toml"\ntare = "tare.json"'))
    assert settings.rig_name == tare.rig
    assert settings.tare == tare


def test_a_model_is_chosen_by_its_name(written):
    settings = read_configuration(written('model = "stiffening"'))
    assert settings.model == MODELS["stiffening"]


def test_all_problems_are_reported_at_once_each_with_the_file_and_the_key(written):
    path = written(
        'rate_hz = "fast"\nbandwith_hz = 3\n[signal]\nkind = "sine"\nfreq = 3\n'
        "[admittance]\nmass = -1\n"
    )
    with pytest.raises(InputError) as refused:
        read_configuration(path)
    keys = {
        line.removeprefix(f"{path}: ").partition(":")[0] for line in str(refused.value).splitlines()
    }
    assert keys == {
        "rate_hz",
        "bandwith_hz",
        "signal.frequency",
        "signal.freq",
        "admittance",
    }


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("duration = 3", "duration: unknown setting: expected duration_s"),
        ("depth = 3\nseed = []", "depth: unknown setting: expected depth_m"),
        ("force_lag = 1\nduration_s = -1", "force_lag: unknown setting: expected force_lag_s"),
        ("[preset]\nforgetting = 0.9", "preset: unknown setting"),
        ("[limits]\nhard_force = 1000", "limits: unknown setting"),
    ],
)
def test_a_key_without_its_unit_and_a_value_that_follows_from_others_are_refused(
    written, text, problem
):
    with pytest.raises(InputError, match=problem):
        read_configuration(written(text))


def test_values_out_of_range_are_reported_at_once(written):
    with pytest.raises(InputError) as refused:
        read_configuration(written('rate_hz = 1\nduration_s = -1\ncondition = "odd"'))
    for word in ("rate 1 Hz", "duration -1 s", "condition: expected one of free, mimic"):
        assert word in str(refused.value)
    assert len(str(refused.value).splitlines()) == 3


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        (
            'signal = "chirp"',
            ['signal: expected a table, signal = { kind = "chirp", low = ..., high = ..., sweep'],
        ),
        ("signal = { frequency = 2 }", ['signal: expected a table, signal = { kind = "sine", f']),
        (
            'signal = { kind = "square" }',
            ["signal: kind 'square': expected one of sine, multisine, chirp"],
        ),
        (
            "[estimator_parameters.rls]\nadaptation_gain = 0.99\nforgeting = 0.9",
            [
                "estimator_parameters.rls.adaptation_gain: expected a list of 2 numbers, got 0.99",
                "estimator_parameters.rls.forgeting: unknown setting: expected one of forgetting, ",
            ],
        ),
        (
            'duration_s = "5 s"\nseed = 1.5\nspecimen = 3\nbandwith_hz = 3',
            [
                "duration_s: expected a number, got '5 s'",
                "seed: expected a whole number, got 1.5",
                "specimen: expected text in quotes, got 3",
                "bandwith_hz: unknown setting: expected bandwidth_hz",
            ],
        ),
        ("coupling = 3", ["coupling: expected a table with keys such as scale, position_gain"]),
        ('estimators = "rls"', ["estimators: expected a list of texts in quotes, got 'rls'"]),
        ("estimator_parameters = 3", ["estimator_parameters: expected a table, got 3"]),
        ("[custom_setup]\nforce_lag = 1", ["custom_setup.cube: is missing", "custom_setup.depth"]),
    ],
)
def test_a_value_of_a_wrong_form_is_refused_in_plain_words(written, text, problems):
    path = written(text)
    with pytest.raises(InputError) as refused:
        read_configuration(path)
    lines = [line.removeprefix(f"{path}: ") for line in str(refused.value).splitlines()]
    assert len(lines) == len(problems)
    for problem in problems:
        assert any(line.startswith(problem) for line in lines), lines
    for word in ("valid", "input", "tuple", "dictionary", "instance", "discriminator"):
        assert word not in str(refused.value).replace(str(path), "")


def test_a_syntax_error_is_reported_with_its_line(written):
    path = written("duration_s = 3\n[estimator_parameters.rls]\nforgetting = = 0.99\nx = 1")
    with pytest.raises(InputError) as refused:
        read_configuration(path)
    assert str(refused.value) == (
        f"{path}: not a TOML file: line 3, column 14, invalid value: forgetting = = 0.99"
    )


@pytest.mark.parametrize("text", ["rate_hz = ", "[" * 2000])
def test_a_file_that_is_no_toml_is_refused(written, text):
    with pytest.raises(InputError, match="not a TOML file"):
        read_configuration(written(text))


def test_a_recorded_trial_runs_again_to_the_bit(tmp_path):
    settings = TrialSettings("autonomous", duration=0.5, clock="virtual", seed=4, depth=3e-3)
    first = run_trial(settings, tmp_path / "first.mcap")
    again = run_trial(read_configuration(tmp_path / "first.mcap"), tmp_path / "again.mcap")
    assert again.settings == settings
    for name, column in first.recording.columns.items():
        if not name.endswith(("_time", "lateness")):
            np.testing.assert_array_equal(column, again.recording[name])


def test_the_schema_names_every_key_with_its_description():
    found = schema()
    assert [*found["properties"]] == [KEYS[f.name] for f in fields(TrialSettings)]
    assert all(part["description"] for part in found["properties"].values())
    json.dumps(found)


def test_the_command_writes_a_file_that_it_accepts(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["config", "init"]) == 0
    assert main(["config", "check", "trial.toml"]) == 0
    assert read_configuration(tmp_path / "trial.toml") == TrialSettings()
    assert main(["config", "init"]) == 2
    assert "--overwrite" in capsys.readouterr().err


def test_the_file_of_init_lists_the_limits_that_can_be_tightened(tmp_path):
    text = write_configuration(TrialSettings())
    for key in ("soft_force", "hard_force", "soft_position", "max_velocity"):
        assert f"\n# {key} = # " in text.partition("[tightened_limits]")[2]


def test_check_reports_each_problem_on_a_line_of_its_own(written, capsys):
    assert main(["config", "check", str(written("rate_hz = 1\nduration_s = -1"))]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


def test_the_schema_is_printed(capsys):
    assert main(["config", "schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "Configuration of a trial"


def test_options_override_the_file(written, tmp_path, capsys):
    path = written('clock = "virtual"\nduration_s = 0.3\ncondition = "autonomous"\nseed = 5')
    record = tmp_path / "run.mcap"
    assert main(["run", "--config", str(path), "--seed", "6", "--record", str(record)]) == 0
    settings = read_configuration(record)
    assert settings == replace(read_configuration(path), seed=6)
    assert load(record).settings["seed"] == 6


def test_specimen_operator_and_notes_are_in_the_recording_and_the_summary(tmp_path, capsys):
    record = tmp_path / "run.mcap"
    named = ["--specimen", "liver 3", "--operator", "A. B.", "--notes", "warm"]
    assert main(["run", *SHORT, *named, "--record", str(record), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    session = load(record).session
    for found in (summary, session):
        assert [found[name] for name in ("specimen", "operator", "notes")] == named[1::2]
    assert read_configuration(record).specimen == "liver 3"


@pytest.mark.parametrize("notes", ["warm\0", "caf\udce9"])
def test_notes_that_a_recording_cannot_contain_are_refused(notes):
    with pytest.raises(InputError, match="notes: expected Unicode text"):
        TrialSettings(notes=notes)


def test_a_recording_without_the_newer_settings_still_runs_again(tmp_path, monkeypatch):
    older = to_document(TrialSettings(seed=4, depth=3e-3))
    for key in ("specimen", "operator", "notes", "tightened_limits", "estimator_parameters"):
        del older[key]
    del older["preset"]["own"]
    monkeypatch.setattr("teleop.trial.metadata.to_document", lambda settings: older)
    run_trial(TrialSettings(duration=0.3, clock="virtual", seed=4), tmp_path / "old.mcap")
    assert read_configuration(tmp_path / "old.mcap") == TrialSettings(seed=4, depth=3e-3)
    assert main(["estimate", str(tmp_path / "old.mcap")]) == 0


def test_an_older_recording_on_a_rig_names_what_it_lacks(tmp_path, monkeypatch, refused):
    older = to_document(TrialSettings(rig=read_rig_file(RIG))) | {"cube": "hard"}
    del older["specimen"]
    monkeypatch.setattr("teleop.trial.metadata.to_document", lambda settings: older)
    run_trial(TrialSettings(duration=0.3, clock="virtual"), tmp_path / "old.mcap")
    line = refused("run", "--config", tmp_path / "old.mcap", "--yes")
    assert "--specimen NAME" in line
    assert "--depth 3mm" in line


def test_a_single_limit_is_tightened_and_the_others_stay(written):
    settings = read_configuration(written("[tightened_limits]\nsoft_force = 10.0"))
    plain = TrialSettings().limits
    assert settings.limits == replace(plain, soft_force=10.0)
    assert from_document(to_document(settings)) == settings


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ("soft_force = 1e3", r"soft_force: 1000.0 is looser than 200.0.*'serial board'"),
        ("soft_position = [-0.1, 0.01]", r"soft_position: .* is looser than \(-0.045, 0.025\)"),
        ("hard_force = 10.0", "soft force limit 200 N is above the hard one, 10 N"),
        ("max_acceleration = 1.0", "max_acceleration: unknown setting"),
    ],
)
def test_a_limit_that_is_looser_than_that_of_the_rig_is_refused(written, limits, problem):
    path = written(f'rig = "{RIG}"\n[tightened_limits]\n{limits}')
    with pytest.raises(InputError, match=problem):
        read_configuration(path)


def test_limits_of_a_rig_cannot_be_replaced_by_a_file(written):
    text = write_configuration(TrialSettings(custom_limits=TrialSettings().limits))
    with pytest.raises(InputError, match="expected tightened_limits"):
        read_configuration(written(f'rig = "{RIG}"\n' + text.replace('cube = "soft"', "")))


def test_a_depth_beyond_a_tightened_limit_is_refused(written):
    text = "depth_m = 0.005\n[tightened_limits]\nsoft_position = [-0.001, 0.004]"
    with pytest.raises(InputError, match="depth 5 mm: expected at most 4 mm"):
        read_configuration(written(text))


PAGES = "".join(
    (RIG.parents[1] / "docs" / name).read_text(encoding="utf-8")
    for name in ("howto-configure.md", "simulated-rig.md")
)


@pytest.mark.parametrize("block", re.findall(r"```toml\n(.*?)```", PAGES, re.DOTALL))
def test_the_examples_of_the_documentation_are_accepted(written, block):
    assert read_configuration(written(block)) != TrialSettings()


def test_parameters_of_single_estimators_are_set(written):
    text = 'estimators = ["rls", "rls_sift"]\n[estimator_parameters.rls]\nforgetting = 0.99'
    settings = read_configuration(written(text))
    bank = settings.estimation_preset.bank()
    assert bank["rls"].parameters.beta == 0.99
    assert bank["rls_sift"].parameters == (
        replace(settings, estimator_parameters={}).estimation_preset.bank()["rls_sift"].parameters
    )
    assert from_document(to_document(settings)) == settings


def test_all_problems_of_estimator_parameters_are_reported(written):
    path = written(
        "[estimator_parameters.rls]\nforgetting = 1.5\n[estimator_parameters.me]\nforgetting = 0.9"
    )
    with pytest.raises(InputError) as refused:
        read_configuration(path)
    first, second = str(refused.value).splitlines()
    assert "rls: forgetting factor must be in (0, 1]" in first
    assert "me: forgetting: not a setting of this estimator" in second
    with pytest.raises(InputError, match="estimator 'odd': expected"):
        read_configuration(written("[estimator_parameters.odd]\nforgetting = 0.9"))


def test_a_recorded_trial_with_own_parameters_is_estimated_again_to_the_bit(tmp_path, capsys):
    settings = TrialSettings(
        duration=1.0, clock="virtual", estimator_parameters={"rls": OwnSettings(forgetting=0.9)}
    )
    run_trial(settings, tmp_path / "a.mcap")
    assert main(["estimate", str(tmp_path / "a.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["as_online"]


def test_all_problems_of_a_configuration_are_reported_at_once(tmp_path, capsys):
    path = tmp_path / "trial.toml"
    path.write_text(
        'condition = "mimic"\nduration_s = -1.0\nnotes = "a\\u0000"\nestimators = ["kalmann"]\n'
        'rate_hz = "fast"\nodd = 1\nrig = "none.toml"\nsignal = { kind = "chirp", amplitude = 0.1,'
        " low = 0.1, high = 1.0, period = 5.0 }\n"
    )
    capsys.readouterr()
    assert main(["config", "check", str(path)]) == 2
    lines = capsys.readouterr().err.splitlines()
    expected = [
        "specimen: is missing: expected the name of the specimen in the file",
        "depth_m: is missing",
        "none.toml: no such file",
        "rate_hz: expected a number",
        "odd: unknown setting",
        "duration -1 s: expected",
        "notes: expected Unicode text without",
        "kalmann",
    ]
    for part in expected:
        assert sum(part in line for line in lines) == 1, (part, lines)
    assert all(f"{path}: " in line for line in lines)


def test_limits_of_another_rig_are_not_reported_if_the_rig_is_not_known(tmp_path, refused):
    path = tmp_path / "trial.toml"
    path.write_text('rig = "none.toml"\nspecimen = "liver"\ndepth_m = 0.04\n')
    assert "none.toml: no such file" in refused("config", "check", path)


def test_an_invalid_value_does_not_hide_the_limits_of_the_rig():
    with pytest.raises(InputError) as refused:
        TrialSettings(rig=read_rig_file(RIG), notes="a\0", depth=0.045, duration=-1.0)
    assert [line[:8] for line in str(refused.value).splitlines()] == [
        "notes: e",
        "duration",
        "depth 45",
    ]
