"""What `teleop export` writes is evaluated as the recording itself."""

from __future__ import annotations

import json

import pytest

from teleop.cli import main

LIBRARY = {"h5": "h5py", "parquet": "pyarrow"}


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    arguments = ["--clock", "virtual", "--duration", "2", "--force-lag", "0.005"]
    assert main(["run", *arguments, "--record", str(path)]) == 0
    return path


@pytest.fixture
def evaluated(capsys):
    def run(path, *options):
        capsys.readouterr()
        assert main(["estimate", str(path), "--json", *options]) == 0
        document = json.loads(capsys.readouterr().out)
        del document["file"]
        return document

    return run


@pytest.mark.parametrize("ending", ["csv", "h5", "mat", "parquet"])
@pytest.mark.parametrize("options", [(), ("--estimators", "rls,kalman", "--bandwidth", "30")])
def test_an_export_gives_the_same_numbers_as_the_recording(
    trial, tmp_path, evaluated, ending, options
):
    if ending in LIBRARY:
        pytest.importorskip(LIBRARY[ending])
    out = tmp_path / f"trial.{ending}"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    expected = evaluated(trial, *options)
    assert evaluated(out, *options) == expected
    assert expected["as_online"] is (not options)


@pytest.mark.parametrize("ending", ["csv", "h5", "mat", "parquet"])
def test_other_columns_of_an_export_can_be_chosen(trial, tmp_path, evaluated, ending):
    if ending in LIBRARY:
        pytest.importorskip(LIBRARY[ending])
    out = tmp_path / f"trial.{ending}"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    columns = ["--position", "slave_position", "--force", "contact_force"]
    document = evaluated(out, *columns, "--datum", "file")
    assert "as_online" not in document
    fits = (document["least_squares"], evaluated(trial)["least_squares"])
    assert fits[0]["k"] == pytest.approx(fits[1]["k"], rel=0.1)


def test_a_csv_export_without_the_file_beside_it_is_evaluated_as_a_table(
    trial, tmp_path, evaluated
):
    out = tmp_path / "trial.csv"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    out.with_name("trial.csv-metadata.json").unlink()
    document = evaluated(out)
    assert "as_online" not in document
    assert document["samples"] == evaluated(trial)["samples"]


def test_a_damaged_file_beside_a_csv_export_is_named(trial, tmp_path, refused):
    out = tmp_path / "trial.csv"
    assert main(["export", str(trial), "--out", str(out)]) == 0
    out.with_name("trial.csv-metadata.json").write_text("{")
    assert "trial.csv-metadata.json: cannot be read" in refused("estimate", out)
