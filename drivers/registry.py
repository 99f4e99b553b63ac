"""Find the Python class for a kind of device, for example `bota` or `odrive`.

A rig file gives the kind of each device. Other installed packages can add kinds of devices by entry
points of the group `teleop.devices`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import Any

from drivers.device import Device, DeviceSettings

GROUP = "teleop.devices"
"""Group of the entry points with which other packages register device classes."""
RIGS = "teleop.rigs"
"""Group of the entry points with which other packages register classes of whole rigs."""
BUILT_IN = {
    "ati_netft": "drivers.devices.ati_netft:AtiNetFt",
    "board": "drivers.devices.board:Board",
    "bota": "drivers.devices.bota:Bota",
    "cia402": "drivers.devices.cia402:Cia402",
    "dbc": "drivers.devices.dbc:DbcDevice",
    "dynamixel": "drivers.devices.dynamixel:Dynamixel",
    "ft300": "drivers.devices.ft300:Ft300",
    "haply": "drivers.devices.haply:Haply",
    "mit_motor": "drivers.devices.mit_motor:MitMotor",
    "moteus": "drivers.devices.moteus:Moteus",
    "odrive": "drivers.devices.odrive:ODrive",
    "reaction_force": "drivers.devices.reaction_force:ReactionForceObserver",
}
"""Module and class name for each kind of device in this package."""


NAME = re.compile(r"[A-Za-z0-9_.-]+")
"""Pattern of the name of a kind of device."""


def kinds() -> list[str]:
    """Return the names of all kinds of devices that a rig file can contain, sorted."""
    return sorted(BUILT_IN.keys() | offered(GROUP, tuple(sys.path)).names)


@cache
def offered(group: str, path: tuple[str, ...]) -> EntryPoints:
    """Return the classes that the packages in `sys.path` offer; the search takes about 10 ms."""
    return entry_points(group=group)


def loaded_class(group: str, kind: str, built_in: Mapping[str, str]) -> Any:
    """Return the class for a kind of device, of this package or of another installed package."""
    points = tuple(offered(group, tuple(sys.path)).select(name=kind))
    if points and (kind in built_in or len(points) > 1 or not NAME.fullmatch(kind)):
        names = ", ".join(map(package, points))
        raise ValueError(
            f"{kind!r}, a {noun(group)} of the package {names}: expected a name of letters, "
            "digits, _, . and - that no other package has, and teleop neither"
        )
    if kind in built_in:
        module, _, name = built_in[kind].partition(":")
        return getattr(import_module(module), name)
    if not points:
        raise KeyError(kind)
    point = points[0]
    try:
        return point.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        cause = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise unusable(point, f"cannot be loaded: {cause}") from error


def noun(group: str) -> str:
    """Return what a group of entry points contains, for example `device`."""
    return group.removeprefix("teleop.").removesuffix("s")


def unusable(point: EntryPoint, problem: str) -> ValueError:
    """Return (do not raise) an error about a class of another package."""
    which = f"{point.name!r}, a {noun(point.group)} of the package {package(point)}"
    return ValueError(f"{which}: {point.value} {problem}")


def package(point: EntryPoint) -> str:
    """Return name and version of the installed package to which an entry point belongs."""
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown"


def checked_class(group: str, kind: str, built_in: Mapping[str, str], base: type) -> Any:
    """Return the class for a kind of device, which must be derived from `base`, without gaps."""
    found = loaded_class(group, kind, built_in)
    if kind in built_in:
        return found
    (point,) = offered(group, tuple(sys.path)).select(name=kind)
    if not (isinstance(found, type) and issubclass(found, base)):
        raise unusable(point, f"is no class derived from {base.__name__}")
    if missing := sorted(getattr(found, "__abstractmethods__", ())):
        raise unusable(point, f"has no method {', '.join(missing)}")
    return found


def device_class(kind: str) -> type[Device]:
    """Return the Python class for a kind of device."""
    found: type[Device] = checked_class(GROUP, kind, BUILT_IN, Device)
    if kind not in BUILT_IN and not issubclass(getattr(found, "Settings", int), DeviceSettings):
        (point,) = offered(GROUP, tuple(sys.path)).select(name=kind)
        raise unusable(point, "has no class Settings derived from DeviceSettings")
    return found
