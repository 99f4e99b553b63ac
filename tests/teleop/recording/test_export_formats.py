from __future__ import annotations

import csv
import json
import math
import subprocess
import sys

import numpy as np
import pytest

from teleop.cli import main
from teleop.recording import stream
from teleop.recording.export_formats import export_recording
from teleop.recording.recording import load

ENDINGS = ["csv", "h5", "hdf5", "mat", "parquet"]


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    arguments = ["--clock", "virtual", "--duration", "0.5", "--record", str(path)]
    assert main(["run", *arguments]) == 0
    return path


@pytest.fixture(scope="module")
def recording(trial):
    return load(trial)


@pytest.fixture
def exported(trial, tmp_path, capsys):
    def export(ending, *arguments):
        out = tmp_path / f"trial.{ending}"
        assert main(["export", str(trial), "--out", str(out), *arguments]) == 0
        return out

    return export


def need(ending):
    if ending in ("h5", "hdf5"):
        pytest.importorskip("h5py")
    if ending == "parquet":
        pytest.importorskip("pyarrow")


def same(a, b):
    """Return whether arrays are exactly equal; all NaN are equal."""
    return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=True)


def without_infinity(settings):
    if isinstance(settings, dict):
        return {key: without_infinity(value) for key, value in settings.items()}
    if isinstance(settings, list):
        return [without_infinity(value) for value in settings]
    return None if isinstance(settings, float) and not math.isfinite(settings) else settings


def strict(text):
    def constant(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=constant)


def test_csv_has_every_column_with_its_unit_and_all_digits(exported, recording):
    with exported("csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == [f"{name} [{unit}]" for name, unit in recording.units.items()]
    assert len(rows) == len(recording)
    for column, cells in zip(recording.columns.values(), zip(*rows, strict=True), strict=True):
        assert same(np.array([float(cell) for cell in cells]), column)


def test_csv_has_nan_where_the_estimators_were_not_updated(exported, recording):
    with exported("csv").open(newline="") as file:
        first = next(csv.DictReader(file))
    assert float(first["time [s]"]) < 0.0
    assert first["x [m]"] == first["rls_k [N/m]"] == "nan"


def test_estimate_reads_an_exported_csv(exported, capsys):
    path = exported("csv")
    capsys.readouterr()
    assert main(["estimate", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["estimates"]["rls"]["k"] > 0.0


@pytest.mark.parametrize("ending", ["h5", "hdf5"])
def test_hdf5_has_columns_units_session_settings_and_events(exported, recording, ending):
    h5py = pytest.importorskip("h5py")
    with h5py.File(exported(ending)) as file:
        assert set(file) == {*recording.columns, "events"}
        for name, column in recording.columns.items():
            assert same(file[name][:], column)
            assert file[name].attrs["unit"] == recording.units[name]
        attributes = dict(file.attrs)
        assert strict(attributes.pop("settings")) == without_infinity(recording.settings)
        assert attributes == recording.session
        assert [strict(event) for event in file["events"].asstr()] == recording.events


def test_matlab_has_columns_units_session_settings_and_events(exported, recording):
    from scipy.io import loadmat

    path = exported("mat")
    assert path.read_bytes().startswith(b"MATLAB 5.0")
    file = loadmat(path, chars_as_strings=True)
    variables = {name for name in file if not name.startswith("__")}
    assert variables == {*recording.columns, "units", "session", "settings", "events"}
    for name, column in recording.columns.items():
        assert file[name].shape == (len(recording), 1)
        assert same(file[name][:, 0].astype(float), column)
    for name in ("units", "session"):
        struct = file[name][0, 0]
        values = {key: str(struct[key][0]) for key in struct.dtype.names}
        assert values == getattr(recording, name)
    assert strict(file["settings"][0]) == without_infinity(recording.settings)
    assert strict(file["events"][0]) == recording.events


def test_parquet_has_columns_units_session_settings_and_events(exported, recording):
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(exported("parquet"))
    assert table.column_names == list(recording.columns)
    for name, column in recording.columns.items():
        assert same(table[name].to_numpy(), column)
        assert table[name].null_count == 0
        assert table.schema.field(name).metadata[b"unit"].decode() == recording.units[name]
    about = table.schema.metadata
    assert strict(about[b"session"]) == recording.session
    assert strict(about[b"settings"]) == without_infinity(recording.settings)
    assert strict(about[b"events"]) == recording.events


def test_without_out_a_csv_is_written_beside_the_recording(trial, recording, tmp_path, capsys):
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(trial.read_bytes())
    assert main(["export", str(copy)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'copy.csv'}\n"
    assert (tmp_path / "copy.csv").exists()
    assert copy.read_bytes() == trial.read_bytes()


@pytest.mark.parametrize(
    ("ending", "name"),
    [("csv", "csv"), ("H5", "hdf5"), ("hdf5", "hdf5"), ("MAT", "matlab"), ("parquet", "parquet")],
)
def test_json_is_one_document(trial, exported, recording, capsys, ending, name):
    need(ending.lower())
    out = exported(ending, "--json")
    assert json.loads(capsys.readouterr().out) == {
        "file": str(trial),
        "out": str(out),
        "format": name,
        "ticks": len(recording),
        "columns": list(recording.columns),
        "missing_ticks": [],
    }


@pytest.mark.parametrize("name", ["trial.xlsx", "trial", "trial.mcap"])
def test_an_unknown_ending_is_refused_with_a_list_of_the_known_ones(refused, trial, tmp_path, name):
    err = refused("export", trial, "--out", tmp_path / name)
    for ending in (".csv", ".h5", ".mat", ".parquet"):
        assert ending in err
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(("library", "ending"), [("h5py", "h5"), ("pyarrow", "parquet")])
def test_a_library_that_is_not_installed_is_reported_with_the_command_to_install_it(
    refused, trial, tmp_path, monkeypatch, library, ending
):
    need(ending)
    monkeypatch.setitem(sys.modules, library, None)
    out = tmp_path / f"trial.{ending}"
    err = refused("export", trial, "--out", out)
    assert library in err
    assert "expected pip install 'telepalpation[export]'" in err
    assert not out.exists()


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_missing_folder_is_reported(refused, trial, tmp_path, ending):
    out = tmp_path / "none" / f"trial.{ending}"
    assert "cannot be written" in refused("export", trial, "--out", out)


EXPORTS_ON_A_FULL_DISK = """
import resource, sys
from pathlib import Path
from teleop.cli import main
from teleop.recording import stream
from teleop.recording.export_formats import export_recording
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
trial, folder, *endings = sys.argv[1:]
for ending in endings:
    out = Path(folder, f"new.{ending}")
    assert main(["export", trial, "--out", str(out)]) == 2
    assert not out.exists()
    old = Path(folder, f"old.{ending}")
    old.write_text("precious")
    assert main(["export", trial, "--out", str(old), "--overwrite"]) == 2
    assert old.read_text() == "precious"
"""


def test_a_full_disk_is_reported_in_one_line_and_existing_files_are_kept(trial, tmp_path):
    """Run in another process, in which no file can exceed 3000 bytes."""
    pytest.importorskip("resource")
    for ending in ENDINGS:
        need(ending)
    done = subprocess.run(
        [sys.executable, "-c", EXPORTS_ON_A_FULL_DISK, trial, tmp_path, *ENDINGS],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == 2 * len(ENDINGS)
    assert all("cannot be written: file too large" in line for line in lines)
    assert sorted(tmp_path.iterdir()) == sorted(tmp_path / f"old.{e}" for e in ENDINGS)


def test_a_file_that_is_not_a_recording_is_refused(refused, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("Time [s]\n1\n")
    assert "not an MCAP file" in refused("export", table, "--out", tmp_path / "a.mat")
    assert "would overwrite" in refused("export", table)
    assert table.read_text() == "Time [s]\n1\n"


def test_an_incomplete_recording_is_refused_and_nothing_is_written(refused, trial, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(trial.read_bytes()[:-100])
    assert "teleop recover" in refused("export", cut)
    assert not (tmp_path / "cut.csv").exists()


@pytest.mark.parametrize("ending", ["csv", "h5", "parquet"])
def test_export_needs_memory_for_a_block_only(trial, tmp_path, monkeypatch, ending):
    need(ending)
    monkeypatch.setattr(stream, "BLOCK", 16)
    read = stream.read_ticks

    def small_chunks(path, contents):
        for rows in read(path, contents):
            yield from np.array_split(rows, range(16, len(rows), 16))

    monkeypatch.setattr(stream, "read_ticks", small_chunks)
    longest = 0
    joined = stream.tick_values

    def values(rows, columns):
        nonlocal longest
        longest = max(longest, len(rows))
        return joined(rows, columns)

    monkeypatch.setattr(stream, "tick_values", values)
    out = tmp_path / f"blocks.{ending}"
    ticks = export_recording(trial, out).ticks
    assert longest < ticks / 2
    monkeypatch.undo()
    whole = tmp_path / f"whole.{ending}"
    export_recording(trial, whole)
    if ending == "parquet":
        table = pytest.importorskip("pyarrow.parquet").read_table
        assert table(out).to_pandas().equals(table(whole).to_pandas())
    elif ending == "csv":
        assert out.read_bytes() == whole.read_bytes()
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(out) as one, h5py.File(whole) as other:
            assert all(same(one[name][:], other[name][:]) for name in set(one) - {"events"})
