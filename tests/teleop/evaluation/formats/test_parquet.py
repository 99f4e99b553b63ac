from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.reading.signals import read_signals

pyarrow = pytest.importorskip("pyarrow")


def write(path, table):
    from pyarrow import parquet

    parquet.write_table(table, path)
    return path


def test_columns_with_units_in_their_names_are_read(tmp_path, motion):
    table = pyarrow.table(
        {
            "time [s]": motion.t,
            "Weg in mm": motion.x * 1e3,
            "force_N": motion.f,
            "note": ["a"] * 200,
        }
    )
    motion.same(read_signals(write(tmp_path / "data.parquet", table)))


def test_a_column_of_dates_is_a_time(tmp_path, motion):
    times = np.datetime64("2026-01-01T10:00:00", "ns") + (motion.t * 1e9).astype("m8[ns]")
    table = pyarrow.table({"time": times, "x [m]": motion.x, "force [N]": motion.f})
    motion.same(read_signals(write(tmp_path / "data.parquet", table), time="time=s"))


def test_an_empty_cell_is_named(tmp_path, motion, refused):
    force = [None if i == 3 else value for i, value in enumerate(motion.f)]
    table = pyarrow.table({"time [s]": motion.t, "x [m]": motion.x, "force [N]": force})
    path = write(tmp_path / "data.parquet", table)
    assert "data.parquet, sample 4: 'force [N]' is nan, expected a finite" in refused(
        "estimate", path
    )


def test_a_missing_library_and_a_damaged_file_are_reported_in_one_line(
    tmp_path, motion, refused, without
):
    path = write(tmp_path / "data.parquet", pyarrow.table({"time [s]": motion.t}))
    assert "no position column" in refused("estimate", path)
    path.write_bytes(path.read_bytes()[:300])
    assert "data.parquet: cannot be read as Parquet" in refused("estimate", path)
    without("pyarrow")
    assert "Parquet needs pyarrow: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", path
    )
