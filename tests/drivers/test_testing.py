"""The checks for authors of drivers accept the drivers of this project, and find defects."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from drivers.device import ImpedanceDrive, Sample, SerialDevice
from drivers.devices.ati_netft import AtiNetFt
from drivers.devices.board import Board
from drivers.devices.bota import Bota, BotaSettings
from drivers.devices.cia402 import Cia402
from drivers.devices.dbc import DbcDevice
from drivers.devices.dynamixel import Dynamixel
from drivers.devices.ft300 import Ft300
from drivers.devices.mit_motor import MitMotor
from drivers.devices.moteus import Moteus
from drivers.devices.odrive import ODrive
from drivers.testing import check_device, check_drive
from sim_backend.wire.devices.ati_netft import EmulatedAtiNetFt
from sim_backend.wire.devices.board import EmulatedBoard
from sim_backend.wire.devices.bota import EmulatedBota
from sim_backend.wire.devices.cia402 import EmulatedCia402
from sim_backend.wire.devices.dbc import EmulatedDbcDevice
from sim_backend.wire.devices.dynamixel import EmulatedDynamixel
from sim_backend.wire.devices.ft300 import EmulatedFt300
from sim_backend.wire.devices.mit_motor import EmulatedMitMotor
from sim_backend.wire.devices.moteus import EmulatedMoteus
from sim_backend.wire.devices.odrive import EmulatedODrive
from sim_backend.wire.emulated_device import EmulatedSerialDevice

from .shared_line_devices import EmulatedMeter, Meter

ROOT = Path(__file__).parents[2]
WATCHDOG = 0.05
BOARD = {
    "kind": "board",
    "bus": "wire",
    "position_um_per_count": [1.0],
    "velocity_um_per_s_per_count": [1.0],
    "watchdog_ms": 50,
}
CIA402 = {
    "kind": "cia402",
    "bus": "wire",
    "node_id": 5,
    "counts_per_turn": 10_000,
    "travel_mm_per_turn": 5.0,
    "watchdog_ms": 50,
}
ODRIVE = {
    "kind": "odrive",
    "bus": "wire",
    "node": 3,
    "travel_mm_per_turn": 5.0,
    "max_velocity_mm_per_s": 50.0,
    "max_current_a": 10.0,
    "watchdog_ms": 50,
}
OLD_ODRIVE = ODRIVE | {"firmware": "0.5", "torque_constant_nm_per_a": 0.04}
NEW_ODRIVE = ODRIVE | {"firmware": "0.6"}
DBC = {"kind": "dbc", "bus": "wire", "file": str(next(ROOT.glob("rigs/*.dbc")))}
ATI = {"kind": "ati_netft", "bus": "wire", "counts_per_n": 1e6, "counts_per_nm": 1e6}
MOTEUS = {
    "kind": "moteus",
    "bus": "wire",
    "node": 2,
    "travel_mm_per_turn": 5.0,
    "max_velocity_mm_per_s": 50.0,
    "max_torque_nm": 0.5,
    "watchdog_ms": 50,
}
DRIVES = {
    "board": (Board, BOARD, EmulatedBoard),
    "cia402": (Cia402, CIA402, EmulatedCia402),
    "moteus-velocity": (Moteus, MOTEUS | {"mode": "velocity"}, EmulatedMoteus),
    "moteus-torque": (Moteus, MOTEUS | {"mode": "torque"}, EmulatedMoteus),
    "odrive-0.5": (ODrive, OLD_ODRIVE, EmulatedODrive),
    "odrive-0.6": (ODrive, NEW_ODRIVE, EmulatedODrive),
}
DEVICES = DRIVES | {
    "ati_netft": (AtiNetFt, ATI, EmulatedAtiNetFt),
    "bota": (Bota, {"kind": "bota", "bus": "wire"}, EmulatedBota),
    "dbc": (DbcDevice, DBC, EmulatedDbcDevice),
    "ft300": (Ft300, {"kind": "ft300", "bus": "wire"}, EmulatedFt300),
}


def test_a_device_on_a_shared_line_follows_the_rules():
    check_device(Meter, {"kind": "meter", "bus": "wire", "address": 3}, EmulatedMeter, {"force": 1})


class ImpedanceMotor(SerialDevice, ImpedanceDrive):
    """A drive that closes a coupling itself. Its frames are texts."""

    Settings = BotaSettings

    def __init__(self, name, settings):
        super().__init__(name, settings)
        self.drives = {"axis": self}

    def signals(self):
        return {"position": "m"}

    def start(self, port):
        self._port, self._rest = port, b""
        self._wanted = self._state = b"i"
        self._sent = b""
        self._number = 0
        self.idle()

    def receive(self, data, now):
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            try:
                state, number, position = line.split()
                position, number = float(position), int(number)
            except ValueError:
                self.rejected["form"] += 1
                continue
            self.samples["position"] = Sample(position, now)
            if self._wanted == self._state == b"o" != state:
                self.error = self.error or "left operation"
            self._state = state if number == self._number else b""
        self._rest = self._rest[-100:]

    def _want(self, state):
        self._number += state != self._wanted
        self._state = self._state if state == self._wanted else b""
        self._wanted = state
        self._port.write(b"%s %d\n" % (state, self._number))
        return self._state == state

    def enable(self):
        return self._want(b"o")

    def idle(self):
        return self._want(b"i")

    def command(self, position, velocity, stiffness, damping):
        self._sent = b"c %s %s %s %s\n" % tuple(
            repr(float(one)).encode() for one in (position, velocity, stiffness, damping)
        )
        return position, velocity

    def transmit(self):
        if self._wanted == self._state == b"o":
            self._port.write(self._sent)


class EmulatedImpedanceMotor(EmulatedSerialDevice):
    """It closes the coupling, and has a watchdog."""

    def __init__(self, name, settings, mount):
        super().__init__(name, settings, mount)
        self._state, self._number, self._fed = b"i", 0, -math.inf
        self._coupling = (0.0, 0.0, 0.0, 0.0)

    def receive(self, data, now):
        for line in data.splitlines():
            first, *words = line.split()
            if first == b"c":
                self._coupling, self._fed = tuple(map(float, words)), now
            else:
                self._state, self._number, self._fed = first, int(words[0]), now
                self._coupling = (0.0, 0.0, 0.0, 0.0)

    def emit(self, now):
        if now - self._fed > WATCHDOG:
            self._state = b"i"
        position, velocity, stiffness, damping = self._coupling
        x = self.mount.sense("position")
        if self._state == b"o":
            self.mount.push("axis", stiffness * (position - x) + damping * velocity)
        else:
            self.mount.brake("axis")
        return [b"%s %d %s\n" % (self._state, self._number, repr(x).encode())]


def test_a_drive_that_closes_a_coupling_follows_the_rules():
    one = (ImpedanceMotor, {"kind": "bota", "bus": "wire"}, EmulatedImpedanceMotor)
    check_device(*one)
    check_drive(*one, WATCHDOG)


class ZeroBota(Bota):
    """A driver that replaces NaN by 0."""

    def receive(self, data, now):
        before = self.rejected["not finite"]
        super().receive(data, now)
        if self.rejected["not finite"] > before:
            self.samples["fx"] = Sample(0.0, now)


def test_a_driver_that_replaces_nan_by_a_number_is_found():
    with pytest.raises(AssertionError) as error:
        check_device(ZeroBota, {"kind": "bota", "bus": "wire"}, EmulatedBota)
    (line,) = str(error.value).splitlines()
    assert line.startswith("NaN is passed on or rejected, not replaced by a number: fx is 0")


class FailingBota(EmulatedBota):
    """An emulated device with an error."""

    def emit(self, now):
        return 1 / 0


def test_an_error_of_the_emulated_device_is_told_from_one_of_the_driver():
    with pytest.raises(AssertionError) as error:
        check_device(Bota, {"kind": "bota", "bus": "wire"}, FailingBota)
    assert "emit of the emulated device raised ZeroDivisionError" in str(error.value)


def test_a_drive_that_is_not_there_is_named():
    with pytest.raises(AssertionError, match="drive 'hand': expected a drive of the device: axis"):
        check_drive(*DRIVES["cia402"], WATCHDOG, drive="hand")


@pytest.mark.parametrize("kind", DEVICES)
def test_the_devices_of_this_package_follow_the_rules(kind):
    check_device(*DEVICES[kind])


MIT_MOTOR = {
    "kind": "mit_motor",
    "bus": "wire",
    "model": "DM4310",
    "can_id": 3,
    "reply_id": 0x13,
    "travel_mm_per_turn": 500.0,
    "watchdog_ms": 50,
}
DYNAMIXEL = {
    "kind": "dynamixel",
    "bus": "wire",
    "id": 3,
    "model": "XM430-W350",
    "travel_mm_per_turn": 100.0,
    "torque_constant_nm_per_a": 1.0,
    "watchdog_ms": 60,
}
FORCES = BOARD | {"axis_force_n_per_count": [1e-3]}
CUBEMARS = {"model": "AK80-9", "p_max_rad": 12.5, "v_max_rad_per_s": 50, "t_max_nm": 18}
MODES = {
    "board-force": (Board, FORCES | {"velocity_um_per_s_per_count": []}, EmulatedBoard),
    "cia402-csp": (Cia402, CIA402 | {"mode": "csp"}, EmulatedCia402),
    "cia402-cst": (Cia402, CIA402 | {"mode": "cst"}, EmulatedCia402),
    "odrive-torque": (ODrive, NEW_ODRIVE | {"mode": "torque"}, EmulatedODrive),
    "damiao-torque": (MitMotor, MIT_MOTOR | {"mode": "torque"}, EmulatedMitMotor),
    "damiao-impedance": (MitMotor, MIT_MOTOR | {"mode": "impedance"}, EmulatedMitMotor),
    "cubemars": (MitMotor, MIT_MOTOR | CUBEMARS | {"mode": "torque"}, EmulatedMitMotor),
    "dynamixel-velocity": (Dynamixel, DYNAMIXEL | {"mode": "velocity"}, EmulatedDynamixel),
    "dynamixel-position": (Dynamixel, DYNAMIXEL | {"mode": "position"}, EmulatedDynamixel),
    "dynamixel-current": (Dynamixel, DYNAMIXEL | {"mode": "current"}, EmulatedDynamixel),
}


@pytest.mark.parametrize("mode", MODES)
def test_the_drives_follow_the_rules_in_every_mode(mode):
    device, section, emulated = MODES[mode]
    if mode in ("damiao-torque", "cubemars", "dynamixel-velocity"):  # the others differ little
        check_device(device, section, emulated)
    check_drive(device, section, emulated, section["watchdog_ms"] * 1e-3)


@pytest.mark.parametrize("kind", DRIVES)
def test_the_drives_of_this_package_follow_the_rules(kind):
    check_drive(*DRIVES[kind], WATCHDOG)
