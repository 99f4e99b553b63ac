from __future__ import annotations

import struct
from collections import Counter
from pathlib import Path

import pytest

from drivers.devices.dbc import DbcSettings
from sim_backend.wire.devices.dbc import BACKLOG, EmulatedDbcDevice, selections

DBC = """VERSION ""
BS_:
BU_: A
BO_ 291 Force: 8 A
 SG_ Fz : 0|16@1- (-0.01,5) [0|0] "N" A
BO_ 2566844416 Pages: 8 A
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" A
 SG_ Bridge m0 : 8|16@1- (0.001,0) [0|0] "V" A
 SG_ Position m3 : 8|16@1+ (0.5,0) [0|0] "mm" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 2566844416 10;
"""


LOADS = {"Fz": 12.0, "Bridge": 1.5, "Position": 3.5, "Page": 99.0}


@pytest.fixture
def device(tmp_path: Path, bench) -> EmulatedDbcDevice:
    path = tmp_path / "tip.dbc"
    path.write_text(DBC)
    return EmulatedDbcDevice("tip", DbcSettings(kind="dbc", bus="can", file=path), bench)


def test_sends_each_message_at_its_cycle_time_or_every_millisecond(device):
    device.emit(0.0)
    count = Counter(
        frame.arbitration_id for n in range(1, 101) for frame in device.emit(n * 1e-3 + 1e-6)
    )
    assert count == {291: 101, 0x18FEF000: 11}


def test_frames_have_the_layout_of_the_file(device):
    device.emit(0.0)
    force, pages = device.emit(0.5e-3)
    assert struct.unpack_from("<h", force.data) == (-700,)
    assert (force.is_extended_id, pages.is_extended_id) == (False, True)
    assert struct.unpack_from("<Bh", pages.data) == (0, 1500)


def test_multiplexer_values_are_sent_in_turn(device):
    device.emit(0.0)
    pages = [
        frame.data
        for n in range(4)
        for frame in device.emit(n * 10e-3 + 1e-3)
        if frame.is_extended_id
    ]
    assert [struct.unpack_from("<BH", page) for page in pages] == [(0, 1500), (3, 7)] * 2


@pytest.mark.parametrize(("load", "counts"), [(1e6, -(2**15)), (-1e6, 2**15 - 1)])
def test_a_value_out_of_range_is_limited_to_its_bits(device, bench, load, counts):
    bench.loads |= {"Fz": load, "Position": -1.0}
    device.emit(0.0)
    frames = device.emit(0.5e-3)
    assert struct.unpack_from("<h", frames[0].data) == (counts,)
    (second,) = [frame for frame in device.emit(10.5e-3) if frame.is_extended_id]
    assert struct.unpack_from("<BH", second.data) == (3, 0)


def test_called_late_it_sends_a_few_frames_of_backlog(device):
    device.emit(0.0)
    assert len(device.emit(10.0)) == 2 * BACKLOG
    assert device.emit(10.0) == []


def test_multiplexers_may_be_nested():
    tree = ["always", {"outer": {0: ["a"], 1: ["b", {"inner": {2: ["c"], 3: ["d"]}}]}}]
    assert list(selections(tree)) == [
        {"outer": 0},
        {"outer": 1, "inner": 2},
        {"outer": 1, "inner": 3},
    ]
