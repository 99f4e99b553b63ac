from __future__ import annotations

import numpy as np
import pytest

from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.reading.signals import read_signals

nptdms = pytest.importorskip("nptdms")


def write(path, *channels, **properties):
    root = nptdms.RootObject(properties=properties)
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([root, *(nptdms.ChannelObject(*channel) for channel in channels)])
    return path


def test_channels_with_units_are_columns(tmp_path, motion):
    path = write(
        tmp_path / "data.tdms",
        ("Test", "Time", motion.t, {"unit_string": "s"}),
        ("Test", "Position", motion.x * 1e3, {"unit_string": "mm"}),
        ("Test", "Load", motion.f, {"unit_string": "N"}),
        Filter="Butterworth 100 Hz",
    )
    assert motion.same(read_signals(path)).force_filter == "Filter: Butterworth 100 Hz"


def test_the_increment_of_waveforms_is_the_time(tmp_path, motion):
    waveform = {"wf_increment": 0.01, "wf_start_offset": 0.0}
    path = write(
        tmp_path / "data.tdms",
        ("Test", "Stroke", motion.x * 1e3, {**waveform, "unit_string": "mm"}),
        ("Test", "Force (N)", motion.f, waveform),
    )
    motion.same(read_signals(path))


def test_groups_are_blocks_and_dates_are_times(tmp_path, motion, refused):
    times = np.datetime64("2026-01-01T10:00:00", "us") + (motion.t * 1e6).astype("m8[us]")
    channels = []
    for group in ("A", "B"):
        channels += [
            (group, "Time", times, {"unit_string": "s"}),
            (group, "x [m]", motion.x),
            (group, "force [N]", motion.f),
        ]
    path = write(tmp_path / "data.tdms", *channels)
    assert "2 tables, expected --block N: expected one of: 1 'A'" in refused("estimate", path)
    motion.same(read_signals(path, wanted=Wanted(block=2)))


def test_a_missing_library_and_a_damaged_file_are_reported_in_one_line(
    tmp_path, motion, refused, without
):
    path = write(tmp_path / "data.tdms", ("Test", "Force", motion.f))
    assert "no time column" in refused("estimate", path)
    path.write_bytes(path.read_bytes()[:40])
    assert "data.tdms" in refused("estimate", path)
    without("nptdms")
    assert "TDMS needs npTDMS: expected pip install 'telepalpation[formats]'" in refused(
        "estimate", path
    )


def test_what_the_library_warns_of_is_a_note_and_not_printed(tmp_path, motion, capsys):
    path = write(
        tmp_path / "data.tdms",
        ("Test", "Time", motion.t, {"unit_string": "s"}),
        ("Test", "Position", motion.x, {"unit_string": "m"}),
        ("Test", "Load", motion.f, {"unit_string": "N"}),
    )
    path.write_bytes(path.read_bytes() + b"TDSm" + bytes(24) + b"half a segment")
    signals = motion.same(read_signals(path))
    assert signals.notes
    assert all(note.startswith("nptdms: ") for note in signals.notes)
    assert capsys.readouterr() == ("", "")
