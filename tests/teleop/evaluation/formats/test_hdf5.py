from __future__ import annotations

import os

import numpy as np
import pytest

from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.signals import read_signals

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
    assert "HDF5 needs h5py: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", path
    )


def elsewhere(file, kind, name):
    """Add a dataset of 200 samples, whose values are in another file, to an HDF5 file."""
    if kind == "link":
        file["other"] = h5py.ExternalLink(name, "/x")
    elif kind == "external":
        file.create_dataset("other", (200,), float, external=[(name, 0, 1600)])
    else:
        layout = h5py.VirtualLayout((200,), float)
        layout[:] = h5py.VirtualSource(name, "x", (200,))
        file.create_virtual_dataset("other", layout)


@pytest.mark.parametrize("kind", ["link", "external", "virtual"])
def test_no_other_file_is_opened(tmp_path, motion, refused, kind):
    """A FIFO without a writer would be waited for."""
    fifo, path = tmp_path / "fifo", tmp_path / "data.h5"
    os.mkfifo(fifo)
    with h5py.File(path, "w") as file:
        elsewhere(file, kind, str(fifo))
    assert "'other': in other files, expected data in this file" in refused("estimate", path)
    with h5py.File(path, "a") as file:
        write(file, motion)
    assert motion.same(read_signals(path)).notes == ("'other': in other files, left out",)


def test_groups_that_contain_themselves_are_searched_once(tmp_path, motion):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("a")
        write(group, motion)
        for i in range(8):
            group[f"self{i}"] = group
            group[f"file{i}"] = file["/"]
            group[f"soft{i}"] = h5py.SoftLink("/a")
            group[f"lost{i}"] = h5py.SoftLink("/nothing")
    motion.same(read_signals(path))


def test_images_and_datasets_larger_than_the_memory_are_reported(tmp_path, motion, refused):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        write(file, motion)
        file.create_dataset("video", (1 << 14, 1 << 14, 1 << 14), "f8", chunks=(1, 64, 64))
    motion.same(read_signals(path))
    with h5py.File(path, "a") as file:
        file.create_dataset("long", (1 << 42,), "f8", chunks=(64,))
    expected = "it needs more memory than"
    assert expected in refused("estimate", path)
