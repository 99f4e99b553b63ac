"""A recording that a later version may have written with another meaning is refused."""

from __future__ import annotations

import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.recording.recording import load
from teleop.recording.schema import SCHEMA, check_schema
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

LATER = str(SCHEMA + 1)


@pytest.fixture
def later(monkeypatch, tmp_path):
    """A recording of a later schema."""
    path = tmp_path / "later.mcap"
    with monkeypatch.context() as patched:
        patched.setattr("teleop.trial.metadata.SCHEMA", LATER)
        run_trial(TrialSettings(duration=0.2, clock="virtual"), path)
    return path


@pytest.mark.parametrize("command", ["estimate", "report", "export", "recover"])
def test_a_recording_of_a_later_schema_is_refused_with_the_software_that_wrote_it(
    later, refused, command
):
    message = refused(command, later)
    assert f"later.mcap: schema {LATER} of teleop " in message
    assert f"expected at most {SCHEMA}: pip install --upgrade telepalpation" in message


def test_an_export_of_a_later_schema_is_refused(later, monkeypatch, refused):
    with monkeypatch.context() as patched:
        patched.setattr("teleop.recording.schema.SCHEMA", SCHEMA + 1)
        assert main(["export", str(later)]) == 0
    assert f"schema {LATER}" in refused("estimate", later.with_suffix(".csv"))


def test_a_recording_states_its_schema_and_one_without_is_read(tmp_path):
    run_trial(TrialSettings(duration=0.2, clock="virtual"), tmp_path / "trial.mcap")
    assert load(tmp_path / "trial.mcap").session["schema"] == str(SCHEMA)
    check_schema("old.mcap", {})


def test_a_schema_that_is_no_number_is_refused():
    with pytest.raises(InputError, match=r"a\.mcap: schema new of unknown software: expected "):
        check_schema("a.mcap", {"schema": "new"})
