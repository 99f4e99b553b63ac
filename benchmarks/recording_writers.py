"""Write a record in the file formats of other programs, each with the library of the format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

Writer = Callable[[Path, np.ndarray, np.ndarray, np.ndarray], Path]
"""Function that writes a file and returns its path. Arguments: folder, t [s], x [m] and f [N]."""
START = 1_700_000_000_000_000_000
"""Time of the first message of a bag [ns]."""


def text(
    header: str,
    delimiter: str = ",",
    decimal: str = ".",
    encoding: str = "utf-8",
    scale: tuple[float, float, float] = (1.0, 1e3, 1.0),
    suffix: str = ".csv",
) -> Writer:
    """Return a writer of text. `scale` converts t, x and f to the units in the header."""

    def write(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
        columns = np.column_stack([c * s for c, s in zip((t, x, f), scale, strict=True)])
        rows = "".join(delimiter.join(f"{v:.9g}" for v in row) + "\n" for row in columns)
        path = folder / f"data{suffix}"
        path.write_bytes((header + rows.replace(".", decimal)).encode(encoding))
        return path

    return write


CSV = text("Time [s],Position [mm],Force [N]\n")
MACH_1 = text(
    "<Mach-1 File>\n<INFO>\nLoad cell:\t25 kg\n<END INFO>\n\n<Sinusoid>\n<DATA>\n"
    "Time, s\tPosition (z), mm\tFz, N\n",
    "\t",
    suffix=".txt",
)
ZWICK = text(
    'Prüfprotokoll;Größe\nMaße;10;20\n\n"Prüfzeit";"Standardweg";"Standardkraft"\n"s";"mm";"N"\n',
    ";",
    ",",
    "cp1252",
)
BLUEHILL = text(
    '"试样名称","明胶 1"\n\n"时间","压缩位移","载荷"\n"(秒)","(毫米)","(牛顿)"\n', encoding="gbk"
)
UTF_16 = text("Zeit [s]\tWeg in mm\tKraft/N\n", "\t", ",", "utf-16")
OTHER_UNITS = text("Time [ms],Travel [um],Load [kN]\n", scale=(1e3, 1e6, 1e-3))
GRAMS = text("Time [min],Position [cm],Force [gf]\n", scale=(1 / 60, 1e2, 1e3 / 9.80665))


def matlab(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    from scipy.io import savemat

    path = folder / "data.mat"
    units = {"t": "ms", "x": "um", "F": "N"}
    savemat(path, {"test": {"t": t * 1e3, "x": x * 1e6, "F": f, "units": units}})
    return path


def hdf5(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    import h5py

    path = folder / "data.h5"
    with h5py.File(path, "w") as file:
        for name, values, unit in (("time", t, "s"), ("position", x, "m"), ("force", f, "N")):
            file.create_dataset(name, data=values).attrs["unit"] = unit
    return path


def parquet(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    import pyarrow
    from pyarrow.parquet import write_table

    path = folder / "data.parquet"
    table = pyarrow.table({"time [s]": t, "Weg in mm": x * 1e3, "force_N": f})
    write_table(table, path)
    return path


def tdms(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    import nptdms

    path = folder / "data.tdms"
    channels = [
        nptdms.ChannelObject("Test", name, values, {"unit_string": unit})
        for name, values, unit in (("Time", t, "s"), ("Position", x * 1e3, "mm"), ("Load", f, "N"))
    ]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.RootObject(), *channels])
    return path


def excel(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    import openpyxl

    path = folder / "data.xlsx"
    book = openpyxl.Workbook()
    for row in (["Zeit", "Standardweg", "Kraft"], ["s", "mm", "N"]):
        book.active.append(row)
    for row in zip(t.tolist(), (x * 1e3).tolist(), f.tolist(), strict=True):
        book.active.append(row)
    book.save(path)
    return path


def labview(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
    header = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n"
        "***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        f"Samples\t{len(t)}\t{len(t)}\t\nY_Unit_Label\tmm\tN\t\nX_Dimension\tTime\tTime\t\n"
        f"X0\t0.0E+0\t0.0E+0\t\nDelta_X\t{t[1] - t[0]:.6f}\t{t[1] - t[0]:.6f}\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tPosition\tForce\tComment\n"
    )
    return text(header, "\t", suffix=".lvm")(folder, t, x, f)


def bag(version: int, storage: str = "") -> Writer:
    """Return a writer of a ROS bag: the force on one topic, the position on another."""

    def write(folder: Path, t: np.ndarray, x: np.ndarray, f: np.ndarray) -> Path:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore

        store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        types = store.types
        stamp, head = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
        vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
        pack = store.serialize_ros1 if version == 1 else store.serialize_cdr
        forces, joints = "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState"
        zero, none = vector(0.0, 0.0, 0.0), np.array([])
        if version == 1:
            path, writer = folder / "data.bag", rosbag1.Writer(folder / "data.bag")
        else:
            path = folder / "data"
            writer = rosbag2.Writer(
                path, version=9, storage_plugin=rosbag2.StoragePlugin[storage.upper()]
            )
        with writer:
            force = writer.add_connection("/ft", forces, typestore=store)
            joint = writer.add_connection("/joint_states", joints, typestore=store)
            for second, x_now, f_now in zip(t, x, f, strict=True):
                ns = START + round(second * 1e9)
                extra = {"seq": 0} if version == 1 else {}
                header = head(stamp=stamp(ns // 10**9, ns % 10**9), frame_id="tip", **extra)
                message = types[forces](header, wrench(vector(0.0, 0.0, f_now), zero))
                writer.write(force, ns, pack(message, forces))
                message = types[joints](header, ["tip"], np.array([x_now]), none, none)
                writer.write(joint, ns, pack(message, joints))
        return path

    return write


BAG_OPTIONS = ("--force", "/ft.wrench.force.z=N", "--position", "/joint_states.position[0]=m")
