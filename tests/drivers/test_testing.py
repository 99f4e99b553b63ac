"""The checks for authors of drivers accept the drivers of this project, and find defects."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.devices.ati_netft import AtiNetFt
from drivers.devices.board import Board
from drivers.devices.bota import Bota
from drivers.devices.cia402 import Cia402
from drivers.devices.dbc import DbcDevice
from drivers.devices.ft300 import Ft300
from drivers.devices.moteus import Moteus
from drivers.devices.odrive import ODrive
from drivers.testing import check_device, check_drive
from sim_backend.wire.devices.ati_netft import EmulatedAtiNetFt
from sim_backend.wire.devices.board import EmulatedBoard
from sim_backend.wire.devices.bota import EmulatedBota
from sim_backend.wire.devices.cia402 import EmulatedCia402
from sim_backend.wire.devices.dbc import EmulatedDbcDevice
from sim_backend.wire.devices.ft300 import EmulatedFt300
from sim_backend.wire.devices.moteus import EmulatedMoteus
from sim_backend.wire.devices.odrive import EmulatedODrive

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
    "moteus-velocity": (Moteus, MOTEUS | {"control": "velocity"}, EmulatedMoteus),
    "moteus-torque": (Moteus, MOTEUS | {"control": "torque"}, EmulatedMoteus),
    "odrive-0.5": (ODrive, OLD_ODRIVE, EmulatedODrive),
    "odrive-0.6": (ODrive, NEW_ODRIVE, EmulatedODrive),
}
DEVICES = DRIVES | {
    "ati_netft": (AtiNetFt, ATI, EmulatedAtiNetFt),
    "bota": (Bota, {"kind": "bota", "bus": "wire"}, EmulatedBota),
    "dbc": (DbcDevice, DBC, EmulatedDbcDevice),
    "ft300": (Ft300, {"kind": "ft300", "bus": "wire"}, EmulatedFt300),
}


@pytest.mark.parametrize("kind", DEVICES)
def test_the_devices_of_this_package_follow_the_rules(kind):
    check_device(*DEVICES[kind])


@pytest.mark.parametrize("kind", DRIVES)
def test_the_drives_of_this_package_follow_the_rules(kind):
    check_drive(*DRIVES[kind], WATCHDOG)
