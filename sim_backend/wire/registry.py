"""Find the class of the emulated device for a kind of device, for example `odrive`.

The section of each device in a rig file contains its kind. The class can be in this package or in
another installed package.
"""

from __future__ import annotations

from drivers.registry import checked_class
from sim_backend.wire.emulated_device import EmulatedDevice

GROUP = "teleop.emulators"
"""Name of the group of Python entry points by which other packages add emulated devices."""
BUILT_IN = {
    "ati_netft": "sim_backend.wire.devices.ati_netft:EmulatedAtiNetFt",
    "board": "sim_backend.wire.devices.board:EmulatedBoard",
    "bota": "sim_backend.wire.devices.bota:EmulatedBota",
    "cia402": "sim_backend.wire.devices.cia402:EmulatedCia402",
    "dbc": "sim_backend.wire.devices.dbc:EmulatedDbcDevice",
    "dynamixel": "sim_backend.wire.devices.dynamixel:EmulatedDynamixel",
    "ft300": "sim_backend.wire.devices.ft300:EmulatedFt300",
    "haply": "sim_backend.wire.devices.haply:EmulatedHaply",
    "mit_motor": "sim_backend.wire.devices.mit_motor:EmulatedMitMotor",
    "moteus": "sim_backend.wire.devices.moteus:EmulatedMoteus",
    "odrive": "sim_backend.wire.devices.odrive:EmulatedODrive",
}


def emulated_class(kind: str) -> type[EmulatedDevice]:
    """Return the class that emulates devices of a kind."""
    found: type[EmulatedDevice] = checked_class(GROUP, kind, BUILT_IN, EmulatedDevice)
    return found
