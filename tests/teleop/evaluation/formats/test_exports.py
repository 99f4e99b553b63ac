"""What `teleop export` writes is evaluated as the recording itself."""

from __future__ import annotations

import io
import json
import os
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest

from teleop.cli import main
from teleop.errors import InputError
from teleop.evaluation.formats.table import Heading, Table
from teleop.evaluation.reading.exported import COLUMNS, exported_recording

LIBRARY = {"h5": "h5py", "parquet": "pyarrow"}


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    arguments = ["--clock", "virtual", "--duration", "1.5", "--force-lag", "0.005"]
    assert main(["run", *arguments, "--record", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def exported(trial):
    """Return a function that exports the trial once to each kind of file, and returns the path."""
    paths = {}

    def export(ending):
        if ending in LIBRARY:
            pytest.importorskip(LIBRARY[ending])
        if ending not in paths:
            paths[ending] = trial.with_suffix(f".{ending}")
            assert main(["export", str(trial), "--out", str(paths[ending])]) == 0
        return paths[ending]

    return export


def evaluated(path, *options):
    """Return the JSON document that `teleop estimate` prints, without the path of the file."""
    with redirect_stdout(io.StringIO()) as printed:
        assert main(["estimate", str(path), "--json", *options]) == 0
    document = json.loads(printed.getvalue())
    del document["file"]
    return document


OPTIONS = [(), ("--estimators", "rls,kalman", "--bandwidth", "30")]


@pytest.fixture(scope="module")
def expected(trial):
    """Return the documents of the recording, by options."""
    return {options: evaluated(trial, *options) for options in OPTIONS}


@pytest.mark.parametrize(
    ("ending", "options"),
    [("csv", OPTIONS[0]), ("csv", OPTIONS[1]), *((one, ()) for one in ("h5", "mat", "parquet"))],
)
def test_an_export_gives_the_same_numbers_as_the_recording(exported, expected, ending, options):
    assert evaluated(exported(ending), *options) == expected[options]
    assert expected[options]["as_online"] is (not options)


@pytest.mark.parametrize("ending", ["csv", "h5", "mat", "parquet"])
def test_other_columns_of_an_export_can_be_chosen(exported, expected, ending):
    columns = ["--position", "slave_position", "--force", "contact_force"]
    document = evaluated(exported(ending), *columns, "--datum", "file")
    assert "as_online" not in document
    fits = (document["least_squares"], expected[()]["least_squares"])
    assert fits[0]["k"] == pytest.approx(fits[1]["k"], rel=0.1)


def test_a_csv_export_without_the_file_beside_it_is_evaluated_as_a_table(trial, tmp_path, expected):
    out = tmp_path / "trial.csv"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    out.with_name("trial.csv-metadata.json").unlink()
    document = evaluated(out)
    assert "as_online" not in document
    assert document["samples"] == expected[()]["samples"]


def test_a_damaged_file_beside_a_csv_export_is_named(trial, tmp_path, refused):
    out = tmp_path / "trial.csv"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    out.with_name("trial.csv-metadata.json").write_text("{")
    assert "trial.csv-metadata.json: cannot be read" in refused("estimate", out)


DAMAGED = {
    "settings": {
        "[" * 100_000: "the settings of the run are not JSON",
        "[]": "the settings of the run: expected an object",
    },
    "events": {
        "[" * 100_000: "the events of the run are not JSON",
        "{}": "the events of the run: expected a list",
        "[1]": "an event is not an object",
        "[{}]": "an event has no valid time",
        '[{"time": 1, "text": "a", "mode": "fault", "fault": "stale"}]': "an event has no source",
    },
}
"""Texts in an exported file, and what is reported."""


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (name, text, message)
        for name, by_text in DAMAGED.items()
        for text, message in by_text.items()
    ],
    ids=lambda text: text[:30],
)
def test_damaged_settings_and_events_of_an_export_are_reported(name, text, message):
    headings = [Heading(one, unit) for one, unit in COLUMNS.items()]
    columns = {i: np.arange(3.0) for i in range(len(headings))}
    table = Table("trial.h5", headings, columns, 3, str, about={name: text})
    with pytest.raises(InputError, match=message):
        exported_recording(table)


def test_an_export_whose_unit_was_changed_is_refused(trial, tmp_path, refused):
    out = tmp_path / "trial.csv"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    out.write_text(out.read_text().replace("paired_position [m]", "paired_position [mm]"))
    assert "column 'paired_position' is in 'mm': expected 'm'" in refused("estimate", out)


@pytest.mark.skipif(sys.platform != "linux", reason="needs names that are not text")
def test_an_export_whose_name_is_not_text_is_read_again(trial, tmp_path, expected):
    out = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.csv"))
    assert main(["export", str(trial), "--out", str(out)]) == 0
    assert evaluated(out) == expected[()]
