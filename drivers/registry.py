"""Find the Python class for a kind of device, for example `bota` or `odrive`.

A rig file gives the kind of each device. Other installed packages can add kinds of devices by entry
points of the group `teleop.devices`.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from drivers.device import Device

GROUP = "teleop.devices"
"""Group of the entry points with which other packages register device classes."""
BUILT_IN = {
    "board": "drivers.devices.board:Board",
    "bota": "drivers.devices.bota:Bota",
    "cia402": "drivers.devices.cia402:Cia402",
    "dbc": "drivers.devices.dbc:DbcDevice",
    "ft300": "drivers.devices.ft300:Ft300",
    "odrive": "drivers.devices.odrive:ODrive",
    "reaction_force": "drivers.devices.reaction_force:ReactionForceObserver",
}
"""Module and class name for each kind of device in this package."""


def kinds() -> list[str]:
    """Return the names of all kinds of devices that a rig file can contain, sorted."""
    return sorted(BUILT_IN.keys() | entry_points(group=GROUP).names)


def device_class(kind: str) -> type[Device]:
    """Return the Python class for a kind of device.

    Parameters
    ----------
    kind
        Name of the kind, for example `bota`.

    Raises
    ------
    KeyError
        The kind is unknown.
    ImportError
        A package that the class needs is not installed.
    """
    if kind in BUILT_IN:
        module, _, name = BUILT_IN[kind].partition(":")
        found: type[Device] = getattr(import_module(module), name)
        return found
    loaded: type[Device] = entry_points(group=GROUP)[kind].load()
    return loaded
