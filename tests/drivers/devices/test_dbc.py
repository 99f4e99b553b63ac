from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from drivers.devices.dbc import DbcDevice, DbcSettings
from drivers.rig import RigError
from drivers.rig_file import read_rig_file
from sim_backend.wire.devices.dbc import EmulatedDbcDevice
from sim_backend.wire.emulated_device import Mount

DBC = """VERSION ""
BS_:
BU_: A
BO_ 291 Force: 8 A
 SG_ Fz : 7|16@0- (0.01,0) [0|0] "N" A
 SG_ Status : 16|8@1+ (1,0) [0|0] "" A
 SG_ Raw : 32|32@1- (1,0) [0|0] "kN" A
BO_ 2566844416 Pages: 8 A
 SG_ Page M : 0|8@1+ (1,0) [0|0] "" A
 SG_ Bridge m0 : 8|16@1- (0.001,0) [0|0] "V" A
 SG_ Position m1 : 8|16@1- (0.5,0) [0|0] "mm" A
 SG_ Status : 24|8@1+ (1,0) [0|0] "" A
VAL_ 291 Status 0 "fine" 1 "poor" ;
SIG_VALTYPE_ 291 Raw : 1;
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 291 2;
"""
EXTENDED = 0x18FEF000


class Bench(Mount):
    """A device on a bus in virtual time."""

    name, channel = "can", "can0"

    def __init__(self, settings: DbcSettings) -> None:
        self.time = 100.0
        self.loads: dict[str, float] = {}
        self.device = DbcDevice("tip", settings)
        self.emulated = EmulatedDbcDevice("tip", settings, self)
        self.mute = False

    def sense(self, signal: str) -> float:
        assert signal in self.device.signals()
        return self.loads.get(signal, 0.0)

    def drive(self, name: str, velocity: float) -> None:
        raise AssertionError

    brake = drive  # type: ignore[assignment]

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.time += 1e-3
            for frame in self.emulated.emit(self.time):
                if not self.mute:
                    self.device.receive(frame, self.time)
        return bool(condition())

    def run(self, seconds: float) -> None:
        self.wait_for(lambda: False, seconds)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "tip.dbc").write_text(DBC)
    return tmp_path


@pytest.fixture
def settings(folder: Path) -> DbcSettings:
    return DbcSettings(kind="dbc", bus="can", file=folder / "tip.dbc")


@pytest.fixture
def bench(settings: DbcSettings) -> Bench:
    return Bench(settings)


@pytest.fixture
def device(bench: Bench) -> DbcDevice:
    return bench.device


def force(fz: float = 0.0, status: int = 0, raw: float = 0.0) -> can.Message:
    data = struct.pack(">h", round(fz * 100)) + struct.pack("<Bxf", status, raw)
    return can.Message(arbitration_id=291, is_extended_id=False, data=data)


def page(number: int, value: int) -> can.Message:
    data = struct.pack("<BhB4x", number, value, 0)
    return can.Message(arbitration_id=EXTENDED, is_extended_id=True, data=data)


def test_signals_have_the_units_of_the_file_and_the_message_where_a_name_stands_twice(device):
    assert device.signals() == {
        "Fz": "N",
        "Force.Status": "",
        "Raw": "kN",
        "Page": "",
        "Bridge": "V",
        "Position": "mm",
        "Pages.Status": "",
    }


def test_identifiers_of_29_bits_have_bit_31(device):
    assert list(device.identifiers()) == [291, EXTENDED | 1 << 31]


@given(fz=st.integers(-(2**15), 2**15 - 1), raw=st.floats(width=32, allow_nan=False))
def test_decodes_as_struct_does(tmp_path_factory, fz, raw):
    path = tmp_path_factory.getbasetemp() / "law.dbc"
    if not path.exists():
        path.write_text(DBC)
    device = DbcDevice("tip", DbcSettings(kind="dbc", bus="can", file=path))
    data = struct.pack(">hBx", fz, 1) + struct.pack("<f", raw)
    device.receive(can.Message(arbitration_id=291, is_extended_id=False, data=data), 7.0)
    assert device.samples["Fz"] == (pytest.approx(fz * 0.01), 7.0)
    assert device.samples["Force.Status"].value == 1.0
    if abs(raw) < float("inf"):
        assert device.samples["Raw"].value == raw


def test_a_multiplexed_signal_is_sampled_when_its_frame_comes(device):
    device.receive(page(0, 1500), 1.0)
    device.receive(page(1, -7), 2.0)
    assert device.samples["Bridge"] == (1.5, 1.0)
    assert device.samples["Position"] == (-3.5, 2.0)
    assert device.samples["Page"] == (1.0, 2.0)


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        (can.Message(arbitration_id=291, is_extended_id=False, data=b"\0\0\0"), "length"),
        (can.Message(arbitration_id=291, is_extended_id=False, is_remote_frame=True), "remote"),
        (page(9, 0), "multiplexer"),
        (force(raw=float("nan")), "not finite"),
    ],
)
def test_a_frame_that_is_not_as_described_is_rejected(device, frame, why):
    device.receive(frame, 1.0)
    assert device.rejected == {why: 1}


def test_measures_the_values_of_the_emulated_device(bench):
    bench.loads = {"Fz": -12.34, "Raw": 0.25, "Bridge": 1.5, "Position": 3.5, "Pages.Status": 7.0}
    bench.device.start(bench)
    bench.run(10e-3)
    values = {signal: sample.value for signal, sample in bench.device.samples.items()}
    expected = bench.loads | {"Force.Status": 0.0, "Page": values["Page"]}
    assert values == pytest.approx(expected)
    assert not bench.device.rejected


def test_only_the_messages_that_are_named_are_its_own(settings):
    device = DbcDevice("tip", settings.model_copy(update={"messages": ("Force",)}))
    assert list(device.signals()) == ["Fz", "Status", "Raw"]
    assert list(device.identifiers()) == [291]


def test_a_silent_device_is_an_error(settings):
    bench = Bench(settings.model_copy(update={"messages": ("Force",), "timeout_ms": 50.0}))
    bench.mute = True
    with pytest.raises(RigError) as refused:
        bench.device.start(bench)
    assert str(refused.value) == (
        "tip: no frame of Force (0x123) in 0.05 s on can (can0): expected those of tip.dbc"
    )


def test_the_path_is_relative_to_the_rig_files_folder(folder):
    section = {"kind": "dbc", "bus": "can", "file": "tip.dbc"}
    settings = TypeAdapter(DbcSettings).validate_python(section, context={"folder": folder})
    assert settings.file == folder / "tip.dbc"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"file": "none.dbc"}, "none.dbc: no such file"),
        ({"file": "broken.dbc"}, "broken.dbc: not a DBC file: "),
        ({"file": "empty.dbc"}, "empty.dbc: no message in it"),
        ({"messages": ["Forse"]}, "messages: 'Forse': expected some of Force, Pages"),
        ({"timeout_ms": 0}, "timeout_ms"),
        ({"baud": 1}, "baud"),
    ],
)
def test_an_invalid_section_is_refused(folder, change, message):
    (folder / "broken.dbc").write_text("BO_ nonsense")
    (folder / "empty.dbc").write_text('VERSION ""\nBS_:\nBU_: A\n')
    section = {"kind": "dbc", "bus": "can", "file": "tip.dbc"} | change
    with pytest.raises(ValidationError, match=message):
        TypeAdapter(DbcSettings).validate_python(section, context={"folder": folder})


def test_the_example_rig_is_as_expected():
    rig = read_rig_file(Path(__file__).parents[3] / "rigs" / "dbc-sensor.toml")
    tip = rig.make_devices()["tip"]
    assert tip.signals()["Force"] == "N"
