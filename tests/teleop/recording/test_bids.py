"""A recording becomes a run of a data set that the validator of BIDS accepts."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import main
from teleop.recording.recording import load

VALIDATOR = shutil.which("bids-validator-deno", path=str(Path(sys.executable).parent)) or (
    shutil.which("bids-validator-deno")
)
ABOUT = (
    "title=Palpation of livers",
    "authors=Ada Lee; Bo Kim",
    "institution=Laboratory",
    "material=porcine liver",
    "licence=CC-BY-4.0",
    "reference=doi:10.1000/1",
)


@pytest.fixture(scope="module")
def exported(tmp_path_factory) -> tuple[Path, Path]:
    """A recording that was added twice to a data set, and the data set."""
    folder = tmp_path_factory.mktemp("bids")
    recording, dataset = folder / "trial.mcap", folder / "livers"
    options = [word for text in ABOUT for word in ("--about", text)]
    trial = ["--clock", "virtual", "--duration", "0.5", "--specimen", "liver 7", *options]
    assert main(["run", *trial, "--record", str(recording)]) == 0
    for _ in range(2):
        assert main(["export", str(recording), "--bids", str(dataset)]) == 0
    return recording, dataset


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file, delimiter="\t"))


def run_of(dataset: Path, suffix: str, run: int = 1) -> Path:
    name = f"sub-liver7_task-free_tracksys-simulated_run-{run:02d}_{suffix}"
    return dataset / "sub-liver7" / "motion" / name


def test_each_column_is_a_channel_with_its_unit_and_all_digits(exported):
    recording, dataset = exported
    trial = load(recording)
    channels = rows(run_of(dataset, "channels.tsv"))
    assert [one["name"] for one in channels] == list(trial.units)
    samples = np.genfromtxt(run_of(dataset, "motion.tsv"), delimiter="\t", missing_values="n/a")
    for one, column in zip(channels, samples.T, strict=True):
        expected = trial[one["name"]] - (trial["time"][0] if one["name"] == "time" else 0.0)
        np.testing.assert_array_equal(column, expected)
    kinds = {one["name"]: (one["type"], one["units"]) for one in channels}
    assert kinds["time"] == ("LATENCY", "s")
    assert kinds["slave_position"] == ("POS", "m")
    assert kinds["slave_velocity"] == ("VEL", "m/s")
    assert kinds["contact_force"] == ("MISC", "N")


def test_the_metadata_state_who_measured_what_with_which_licence(exported):
    recording, dataset = exported
    described = json.loads((dataset / "dataset_description.json").read_text())
    assert described["Name"] == "Palpation of livers"
    assert described["Authors"] == ["Ada Lee", "Bo Kim"]
    assert described["License"] == "CC-BY-4.0"
    (specimen,) = rows(dataset / "participants.tsv")
    assert (specimen["specimen"], specimen["material"]) == ("liver 7", "porcine liver")
    motion = json.loads(run_of(dataset, "motion.json").read_text())
    assert motion["InstitutionName"] == "Laboratory"
    assert motion["SamplingFrequency"] == 1000.0
    assert motion["teleop"]["settings"] == load(recording).settings
    session = load(recording).session
    assert session["licence"] == "CC-BY-4.0"
    assert session["authors"] == "Ada Lee; Bo Kim"


def test_a_second_recording_of_the_same_specimen_is_a_second_run(exported):
    _, dataset = exported
    assert run_of(dataset, "motion.tsv", 2).exists()
    scans = rows(dataset / "sub-liver7" / "sub-liver7_scans.tsv")
    assert [one["filename"][-17:] for one in scans] == ["run-01_motion.tsv", "run-02_motion.tsv"]


@pytest.mark.skipif(not VALIDATOR, reason="bids-validator-deno is not installed")
def test_the_validator_of_bids_finds_no_error(exported):
    _, dataset = exported
    done = subprocess.run([VALIDATOR, dataset, "--json"], capture_output=True, text=True)
    issues = json.loads(done.stdout)["issues"]["issues"]
    found = {one["code"]: one["severity"] for one in issues}
    assert done.returncode == 0, found
    assert set(found.values()) <= {"warning"}
    assert found.keys() <= {"JSON_KEY_RECOMMENDED", "SIDECAR_KEY_RECOMMENDED"}


def test_the_layout_excludes_an_output_file(exported, refused, tmp_path):
    recording, dataset = exported
    line = refused("export", recording, "--bids", dataset, "--out", tmp_path / "a.csv")
    assert "--bids and --out: expected at most one" in line


def test_a_folder_that_is_a_file_or_a_file_that_is_no_recording_is_refused(exported, refused):
    recording, dataset = exported
    assert "expected a folder" in refused("export", recording, "--bids", recording)
    assert "participants.tsv" in refused("export", dataset / "participants.tsv", "--bids", dataset)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("licence=free for all", "expected an SPDX licence identifier, such as CC-BY-4.0"),
        ("owner=me", "expected NAME=VALUE with title, authors, institution"),
        ("licence", "expected NAME=VALUE"),
        ("title=" + 500 * "x", "at most"),
        ("authors=a\x07b", "expected one line"),
    ],
)
def test_a_wrong_statement_about_the_data_is_refused(refused, text, expected):
    assert expected in refused("run", "--clock", "virtual", "--no-record", "--about", text)


def test_the_configuration_states_the_same_and_an_option_replaces_one_of_it(tmp_path, capsys):
    (tmp_path / "trial.toml").write_text(
        '[about]\nauthors = ["Ada Lee"]\nlicence = "CC0-1.0"\ninstitution = "Laboratory"\n'
    )
    recording = tmp_path / "trial.mcap"
    trial = ["--config", str(tmp_path / "trial.toml"), "--clock", "virtual", "--duration", "0.1"]
    about = ["--about", "licence=CC-BY-4.0"]
    assert main(["run", *trial, *about, "--record", str(recording)]) == 0
    session = load(recording).session
    assert session["licence"] == "CC-BY-4.0"
    assert session["authors"] == "Ada Lee"
    assert session["units"].startswith("SI")
