"""List the kinds of devices that a rig file can contain, with their signals and drives."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping
from itertools import islice, product
from typing import Any, NamedTuple

from drivers.device import (
    DerivedDevice,
    Device,
    ForceDrive,
    ImpedanceDrive,
    PositionDrive,
    VelocityDrive,
)
from drivers.registry import BUILT_IN, GROUP, device_class, kinds, offered
from drivers.rig_file import BUS_KINDS
from sim_backend.wire import registry as emulators
from telepalpation import NAME, __version__

ACCEPTED = {
    VelocityDrive: "velocity",
    PositionDrive: "position",
    ForceDrive: "force",
    ImpedanceDrive: "position, velocity, stiffness, damping",
}
"""What a drive accepts, by its base class."""
MOST = 16
"""Largest number of combinations of settings that are tried."""


class Kind(NamedTuple):
    """A kind of device."""

    name: str
    package: str
    """Name of the installed package with the driver."""
    version: str
    """Version of the package."""
    buses: tuple[str, ...] = ()
    """Kinds of buses to which the device can be connected; empty for a device without a bus."""
    signals: Mapping[str, str] | None = None
    """Unit of each signal; None if the signals depend on the section of the rig file."""
    drives: Mapping[str, str] | None = None
    """What each drive accepts; None if the drives depend on the section of the rig file."""
    emulated: bool = False
    """Whether `teleop rig emulate` can emulate the device."""
    problem: str = ""
    """Why the driver or its emulated device cannot be used; empty if they can."""


def all_kinds() -> list[Kind]:
    """Return all kinds of devices, also those whose driver cannot be loaded."""
    return [described(name) for name in kinds()]


def described(name: str) -> Kind:
    """Return the properties of a kind of device."""
    kind = Kind(name, NAME, __version__)
    if name not in BUILT_IN:
        points = tuple(offered(GROUP, tuple(sys.path)).select(name=name))
        dist = points[0].dist
        kind = Kind(name, *((dist.name, dist.version) if dist else ("unknown", "")))
    try:
        found = device_class(name)
        buses = next((buses for base, buses in BUS_KINDS.items() if issubclass(found, base)), ())
        kind = kind._replace(buses=buses)
        kind = kind._replace(**seen(examples(name, found)))
        if not issubclass(found, DerivedDevice):
            emulators.emulated_class(name)
            kind = kind._replace(emulated=True)
    except KeyError:
        pass  # there is no emulated device
    except (ImportError, ValueError) as error:
        kind = kind._replace(problem=str(error))
    return kind


def seen(devices: list[Device]) -> dict[str, Any]:
    """Return all signals and drives of some devices of a kind; empty if there are none."""
    signals: dict[str, str] = {}
    drives: dict[str, dict[str, None]] = {}
    for device in devices:
        signals |= device.signals()
        for name, drive in device.drives.items():
            text = next((text for base, text in ACCEPTED.items() if isinstance(drive, base)), "")
            drives.setdefault(name, {})[text] = None
    if not signals:
        return {}
    return {"signals": signals, "drives": {one: " or ".join(all_) for one, all_ in drives.items()}}


def examples(name: str, found: type[Device]) -> list[Device]:
    """Return devices with possible settings; an empty list if no settings can be guessed.

    There is one device for each combination of the required words.
    """
    try:
        schema = found.Settings.model_json_schema()
        values = {
            key: example_values(part, schema)
            for key, part in schema["properties"].items()
            if key in schema.get("required", ()) or part.get("type") == "array"
        }
    except Exception:  # a defect of the driver of another package
        return []
    devices = []
    for combination in islice(product(*values.values()), MOST):
        section = dict(zip(values, combination, strict=True)) | {"kind": name}
        # the settings may name a file, and the driver of another package may have a defect
        with contextlib.suppress(Exception):
            device = found(name, found.Settings.model_validate(section))
            device.signals()
            devices.append(device)
    return devices


def example_values(part: Mapping[str, Any], schema: Mapping[str, Any]) -> list[Any]:
    """Return values for a part of a JSON schema: all words of a list, or one value.

    They can be invalid.
    """
    if "$ref" in part:
        part = schema["$defs"][part["$ref"].rpartition("/")[2]]
    if "const" in part:
        return [part["const"]]
    if "enum" in part:
        return list(part["enum"])
    if "anyOf" in part:
        return example_values(part["anyOf"][0], schema)
    if part.get("type") in ("number", "integer"):
        least = part.get("minimum", part.get("exclusiveMinimum", 0) + 1)
        return [min(least, part.get("maximum", least))]
    if part.get("type") == "array":
        return [example_values(part["items"], schema)[:1] * max(1, part.get("minItems", 1))]
    return ["x"]
