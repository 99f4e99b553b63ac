"""Devices by the name of their kind, ours and those of installed packages."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from drivers.device import Device

GROUP = "teleop.devices"
"""Entry points under which other packages offer devices."""
BUILT_IN = {
    "board": "drivers.devices.board:Board",
    "bota": "drivers.devices.bota:Bota",
    "cia402": "drivers.devices.cia402:Cia402",
    "dbc": "drivers.devices.dbc:DbcDevice",
    "ft300": "drivers.devices.ft300:Ft300",
    "odrive": "drivers.devices.odrive:ODrive",
    "reaction_force": "drivers.devices.reaction_force:ReactionForceObserver",
}


def kinds() -> list[str]:
    """The names of all kinds."""
    return sorted(BUILT_IN.keys() | entry_points(group=GROUP).names)


def device_class(kind: str) -> type[Device]:
    """The class of a kind.

    Raises
    ------
    KeyError
        There is none of that name.
    ImportError
        A package that it needs is not installed.
    """
    if kind in BUILT_IN:
        module, _, name = BUILT_IN[kind].partition(":")
        found: type[Device] = getattr(import_module(module), name)
        return found
    loaded: type[Device] = entry_points(group=GROUP)[kind].load()
    return loaded
