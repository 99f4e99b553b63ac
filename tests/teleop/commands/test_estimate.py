"""The settings with which `teleop estimate` evaluates a recording."""

from __future__ import annotations

import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.trial import recorded_trial

SAME = "the estimates are exactly those that the run computed"


@pytest.fixture(scope="module")
def hard(tmp_path_factory):
    path = tmp_path_factory.mktemp("hard") / "hard.mcap"
    trial = ["--condition", "autonomous", "--cube", "hard", "--duration", "2"]
    assert main(["run", *trial, "--clock", "virtual", "--record", str(path)]) == 0
    return path


def test_the_papers_settings_of_a_recording_are_those_for_its_cube(hard, capsys):
    assert main(["estimate", str(hard), "--preset", "paper", "--details"]) == 0
    assert SAME in capsys.readouterr().out


def test_the_option_cube_replaces_the_cube_of_the_recording(hard, capsys):
    assert main(["estimate", str(hard), "--preset", "paper", "--cube", "soft", "--details"]) == 0
    assert SAME not in capsys.readouterr().out


def test_the_file_whose_settings_are_not_valid_is_named(hard, tmp_path, refused, monkeypatch):
    def settings(recording):
        raise InputError("the recording lacks the setting 'preset'")

    monkeypatch.setattr(recorded_trial, "recorded_settings", settings)
    other = tmp_path / "other.mcap"
    other.write_bytes(hard.read_bytes())
    assert f"{hard}: the recording lacks the setting" in refused("estimate", hard, other)
