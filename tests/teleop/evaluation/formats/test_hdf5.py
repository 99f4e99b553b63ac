from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.signals import read_signals

h5py = pytest.importorskip("h5py")


def write(group, motion):
    for name, values, unit in (
        ("time", motion.t, "s"),
        ("position", motion.x * 1e3, "mm"),
        ("force", motion.f, "N"),
    ):
        group.create_dataset(name, data=values).attrs["units"] = unit


def test_datasets_with_units_are_columns(tmp_path, motion):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        write(file, motion)
        file.attrs["force_filter"] = "100 Hz"
        file["comment"] = "gel"
    assert motion.same(read_signals(path)).force_filter == "100 Hz"


def test_groups_are_blocks(tmp_path, motion, refused):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        for name in ("first", "second"):
            write(file.create_group(name), motion)
    message = refused("estimate", path)
    assert "2 tables, expected --block N: expected one of: 1 'first', 200 samples" in message
    motion.same(read_signals(path, wanted=Wanted(block=2)))


def test_a_table_of_fields_is_read(tmp_path, motion):
    path = tmp_path / "data.h5"
    rows = np.rec.fromarrays(
        [motion.t, motion.x * 1e3, motion.f], names="time_s,position_mm,force_N"
    )
    with h5py.File(path, "w") as file:
        file.create_dataset("table", data=rows)
    motion.same(read_signals(path))


def test_a_missing_library_and_a_damaged_file_are_reported_in_one_line(
    tmp_path, motion, refused, without
):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        write(file, motion)
    whole = path.read_bytes()
    path.write_bytes(whole[:900])
    assert "data.h5: cannot be read as HDF5" in refused("estimate", path)
    path.write_bytes(whole)
    without("h5py")
    assert "HDF5 needs h5py: pip install '.[formats]'" in refused("estimate", path)
