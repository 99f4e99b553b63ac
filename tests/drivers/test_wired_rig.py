"""A hardware rig: channels, drives and failures."""

from __future__ import annotations

import math
from typing import Literal

import pytest

from drivers import STANDSTILL, Command, NotStoppedError, RigError
from drivers import rig_file as module
from drivers import wired_rig as wiring
from drivers.device import Device, DeviceSettings, Sample, VelocityDrive
from drivers.transports.bus import Bus
from drivers.wired_rig import ENABLING, LONGEST_STOP, WiredRig

TEXT = """
name = "fake"
[buses.wire]
kind = "serial"
port = "none"
baud_bps = 1
[devices.all]
kind = "fake"
[channels.master_force]
device = "all"
signal = "bridge"
scale = 20.0
sign = -1
offset_n = 3.0
range_n = [-100, 100]
[channels.contact_force]
device = "all"
signal = "force"
lag_ms = 2.0
range_n = [-100, 100]
[channels.slave_position]
device = "all"
signal = "position"
offset_mm = 1.5
range_mm = [-100, 100]
[drives.slave]
device = "all"
drive = "b"
sign = -1
max_velocity_mm_per_s = 100
[drives.master]
device = "all"
drive = "a"
max_velocity_mm_per_s = 50
[limits]
max_velocity_mm_per_s = 200
max_acceleration_m_per_s2 = 10
max_master_velocity_mm_per_s = 200
max_master_acceleration_m_per_s2 = 10
soft_position_mm = [-45, 25]
hard_position_mm = [-50, 30]
soft_force_n = 200
hard_force_n = 250
following_error_mm = 2
"""


class FakeDrive(VelocityDrive):
    def __init__(self):
        self.calls = []
        self.ready = True
        self.failing = False
        self.confirming = True

    def enable(self):
        self.calls.append("enable")
        return self.ready

    def command(self, velocity):
        self.calls.append(velocity)
        return 0.5 * velocity

    def idle(self):
        self.calls.append("idle")
        if self.failing:
            raise RigError("the port is gone")
        return self.confirming


class FakeSettings(DeviceSettings):
    kind: Literal["fake"]


class FakeDevice(Device):
    Settings = FakeSettings

    def __init__(self, name, settings):
        super().__init__(name, settings)
        self.drives = {"a": FakeDrive(), "b": FakeDrive()}
        self.transmitted = 0

    def signals(self):
        return {"bridge": "V", "force": "N", "position": "m"}

    def transmit(self):
        self.transmitted += 1


class FakeBus(Bus):
    def open(self): ...

    def connect(self, device): ...

    def poll(self): ...

    def close(self): ...


class Time:
    """A clock that advances by 1 ms with each wait."""

    def __init__(self):
        self.now = 5.0

    def __call__(self):
        return self.now


@pytest.fixture
def time():
    return Time()


@pytest.fixture
def rig(tmp_path, monkeypatch, time):
    monkeypatch.setattr(module, "device_class", lambda kind: FakeDevice)
    monkeypatch.setattr(module, "kinds", lambda: ["fake"])
    bus = FakeBus("wire", time)

    def nap(seconds):
        time.now += seconds

    bus.nap = nap
    monkeypatch.setattr(wiring, "make_bus", lambda *_: bus)
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    return WiredRig(module.read_rig_file(path), time)


@pytest.fixture
def device(rig, time):
    device = rig.devices["all"]
    for signal, value in {"bridge": 0.5, "force": 7.0, "position": 0.01}.items():
        device.samples[signal] = Sample(value, time.now - 0.004)
    return device


def test_channels_are_scaled_signed_shifted_and_dated(rig, device):
    m = rig.read()
    assert m.master_force == pytest.approx(-20.0 * 0.5 + 3.0)
    assert m.contact_force == 7.0
    assert m.slave_position == pytest.approx(0.0115)
    assert m.age.master_force == pytest.approx(4e-3)
    assert m.age.contact_force == pytest.approx(6e-3)


def test_channels_that_the_rig_does_not_have_are_nan_and_of_no_age(rig, device):
    m = rig.read()
    assert math.isnan(m.master_position)
    assert math.isnan(m.slave_velocity)
    assert m.age.slave_velocity == 0.0


def test_errors_and_emergency_stops_of_devices_reach_the_measurement(rig, device):
    assert rig.read().drive_error == ""
    device.error, device.emergency_stop = "overheated", True
    assert rig.read().drive_error == "all: overheated"
    assert rig.read().emergency_stop


def test_commands_are_limited_and_signed_and_the_applied_command_is_returned(rig, device):
    assert rig.enable()
    applied = rig.write(Command(0.02, 0.3))
    assert device.drives["a"].calls[-1] == 0.02
    assert device.drives["b"].calls[-1] == -0.1
    assert applied == pytest.approx((0.01, 0.05))
    assert device.transmitted == 1


def test_drives_that_are_not_enabled_get_zero_velocity(rig, device):
    assert rig.write(Command(0.02, 0.02)) == STANDSTILL
    assert device.drives["b"].calls == [0.0]


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_command_that_is_not_finite_is_not_sent(rig, device, wrong):
    rig.enable()
    with pytest.raises(ValueError, match="finite"):
        rig.write(Command(0.0, wrong))
    assert device.drives["b"].calls == ["enable"]


def test_the_rig_is_enabled_once_every_drive_is(rig, device):
    device.drives["a"].ready = False
    assert not rig.enable()
    device.drives["a"].ready = True
    assert rig.enable()


def test_a_drive_that_does_not_get_ready_is_named(rig, device, time):
    device.drives["a"].ready = False
    assert not rig.enable()
    time.now += ENABLING + 0.01
    with pytest.raises(RigError, match="drive master not ready"):
        rig.enable()


def test_every_drive_is_idled_even_if_one_cannot_be(rig, device):
    rig.enable()
    device.drives["a"].failing = device.drives["b"].failing = True
    with pytest.raises(RigError, match="gone"):
        rig.idle()
    assert all(drive.calls[-1] == "idle" for drive in device.drives.values())
    assert rig.write(Command(0.1, 0.1)) == STANDSTILL


def test_a_stop_is_repeated_at_the_close_until_the_drives_confirm_it(rig, device, time):
    rig.enable()
    slave = device.drives["b"]
    slave.confirming = False
    assert not rig.idle()
    rig.buses["wire"].pump = lambda: setattr(slave, "confirming", time.now > 5.2)
    rig.close()
    assert slave.calls.count("idle") > 50
    assert rig.idle()


def test_a_drive_that_does_not_confirm_a_stop_is_named(rig, device, time):
    rig.enable()
    device.drives["b"].confirming = False
    assert not rig.idle()
    with pytest.raises(NotStoppedError, match=r"drive slave: no confirmation within 0.5 s"):
        rig.close()
    assert time.now > 5.0 + LONGEST_STOP
    assert rig.enable()
    assert not rig.idle()


def test_a_bus_that_fails_does_not_keep_the_others_from_being_read(rig, device, time):
    class Failing(FakeBus):
        def poll(self):
            raise RigError("first: the port is gone")

    read = []
    rig.buses["wire"].poll = lambda: read.append(time.now)
    rig.buses = {"first": Failing("first", time), **rig.buses}
    with pytest.raises(RigError, match="first: the port is gone"):
        rig.read()
    assert read


def test_a_rig_that_was_not_enabled_is_closed_without_waiting(rig, device, time):
    device.drives["b"].confirming = False
    rig.idle()
    rig.close()
    assert time.now == 5.0


def test_opening_waits_for_the_first_sample_of_every_channel(rig, device, time):
    device.samples["position"] = Sample(math.nan, -math.inf)
    device.rejected["checksum"] = 12
    with pytest.raises(RigError, match=r"no sample of slave_position \(all.*12 rejected for check"):
        rig.open()
    device.samples["position"] = Sample(0.0, time.now)
    rig.open()
