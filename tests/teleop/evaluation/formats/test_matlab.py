from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat

from teleop.errors import InputError
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.signals import read_signals


@pytest.mark.parametrize("oned_as", ["row", "column"])
def test_variables_with_units_are_columns(tmp_path, motion, oned_as):
    path = tmp_path / "data.mat"
    units = {"time": "s", "position": "mm", "force": "N"}
    content = {"time": motion.t, "position": motion.x * 1e3, "force": motion.f, "units": units}
    savemat(path, content, oned_as=oned_as)
    motion.same(read_signals(path))


def test_fields_of_a_struct_are_columns(tmp_path, motion):
    path = tmp_path / "data.mat"
    units = {"t": "ms", "x": "um", "F": "N"}
    data = {"t": motion.t * 1e3, "x": motion.x * 1e6, "F": motion.f, "units": units}
    savemat(path, {"test": data, "comment": "gel"}, oned_as="column")
    motion.same(read_signals(path))


def test_columns_of_a_matrix_are_numbered(tmp_path, motion, refused):
    path = tmp_path / "data.mat"
    savemat(path, {"data": np.stack([motion.t, motion.x, motion.f], axis=1), "fs": 100.0})
    assert "columns: 'data[1]', 'data[2]', 'data[3]' (without units)" in refused("estimate", path)
    motion.same(read_signals(path, time="data[1]=s", position="data[2]=m", force="data[3]=N"))


def test_a_variable_without_a_unit_is_named_with_the_option(tmp_path, motion, refused):
    path = tmp_path / "data.mat"
    savemat(path, {"position": motion.x, "force": motion.f})
    assert "--rate HZ" in refused("estimate", path)
    assert "--position 'position=UNIT'" in refused("estimate", path, "--rate", 100)
    motion.same(read_signals(path, "position=m", "force=N", wanted=Wanted(rate=100.0)))


def test_a_sample_that_is_no_number_is_named(tmp_path, motion):
    path = tmp_path / "data.mat"
    motion.f[5] = np.nan
    savemat(path, {"time": motion.t, "x": motion.x, "force": motion.f})
    with pytest.raises(InputError, match="data.mat, sample 6: 'force' is nan, expected a finite"):
        read_signals(path, "x=m", "force=N", "time=s")


@pytest.mark.parametrize("cut", [130, 200, 1000, 3000])
def test_a_damaged_file_is_refused_in_one_line(tmp_path, motion, refused, cut):
    path = tmp_path / "data.mat"
    savemat(path, {"time": motion.t, "position": motion.x, "force": motion.f})
    path.write_bytes(path.read_bytes()[:cut])
    assert "data.mat" in refused("estimate", path)


def test_version_7_3_is_read(tmp_path, motion, without, refused):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "data.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", motion.t), ("x", motion.x * 1e3), ("F", motion.f)):
            file.create_dataset(f"test/{name}", data=values[np.newaxis])
        for name, unit in (("t", "s"), ("x", "mm"), ("F", "N")):
            text = file.create_dataset(
                f"test/units/{name}", data=np.array([[ord(c)] for c in unit], np.uint16)
            )
            text.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("matrix", data=np.stack([motion.t, motion.x, motion.f]))
    with path.open("r+b") as disk:
        disk.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    motion.same(read_signals(path))
    motion.same(read_signals(path, "matrix[2]=m", "matrix[3]=N", "matrix[1]=s"))
    without("h5py")
    assert "HDF5 needs h5py: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", path
    )
