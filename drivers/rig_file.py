"""Read and check rig files.

A rig file is a TOML file that describes a telemanipulator. It gives the device for each channel
(measured quantity) and each drive, and the bus of each device. One error lists all problems.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from drivers.coupling import CouplingParameters
from drivers.device import (
    CanDevice,
    DatagramDevice,
    DerivedDevice,
    Device,
    DeviceSettings,
    ForceDrive,
    ImpedanceDrive,
    PositionDrive,
    SerialDevice,
    SharedSerialDevice,
    sole_drive,
)
from drivers.input_file import read_input
from drivers.problems import syntax_problem, value_problem
from drivers.registry import device_class, kinds
from drivers.rig import UNITS, RigError
from drivers.rig_sections import (
    USUAL_RATE,
    AnyBusSettings,
    DriveSettings,
    MeasurementSettings,
    RigSections,
    UdpSettings,
    coupling_of,
)

BUS_KINDS = {
    SerialDevice: ("serial", "tcp"),
    SharedSerialDevice: ("serial", "tcp"),
    CanDevice: ("can",),
    DatagramDevice: ("udp",),
}
"""Kinds of buses to which a device can be connected, by its base class."""


class RigFileError(ValueError):
    """A rig file is invalid. Each line of the message names the file, the key and one problem."""


@dataclass(frozen=True)
class RigFile:
    """Content of a valid rig file, which is a TOML file that describes a telemanipulator."""

    path: Path
    """Path of the file."""
    text: str
    """Text of the file, unchanged."""
    sections: RigSections
    """All sections except those of the devices."""
    devices: dict[str, DeviceSettings] = field(default_factory=dict)
    """Settings of the devices, by name."""

    def make_devices(self) -> dict[str, Device]:
        """Return a new object for each device, by the name of the device.

        The devices are not yet connected to their buses.
        """
        return {
            name: device_class(settings.kind)(name, settings)
            for name, settings in self.devices.items()
        }

    def coupling(self, axis: str, period: float) -> CouplingParameters | None:
        """Return the coupling of the drive of an axis (`master`, `slave`); None if it has none.

        `period` is the period of the control loop [s].
        """
        settings = getattr(self.sections.drives, axis)
        coupling = settings and coupling_of(settings, period)
        if coupling and (rate := self._drive_rates.get(axis)):
            coupling = replace(coupling, drive_period=1.0 / rate)
        return coupling

    @cached_property
    def _drive_rates(self) -> dict[str, float]:
        """Rate of each drive that closes its coupling itself [Hz], by its axis."""
        devices, rates = self.make_devices(), {}
        for axis, settings in self.sections.drives.items():
            device = devices[settings.device]
            drive = device.drives[sole_drive(device, settings.drive)]
            if isinstance(drive, ImpedanceDrive):
                rates[axis] = settings.drive_rate_hz or drive.rate
        return rates


def read_rig_file(path: Path) -> RigFile:
    """Read and check a rig file, and return its content."""
    raw = read_input(path)
    try:
        text = raw.decode()
    except ValueError as error:
        raise RigFileError(f"{path}: not a TOML file: {error}") from error
    return parse_rig_file(path, text)


def parse_rig_file(path: Path, text: str) -> RigFile:
    """Check the text of a rig file, and return its content."""
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise RigFileError(f"{path}: {syntax_problem(error, text)}") from error
    problems: list[str] = []
    declared = tree.pop("devices", {})
    devices = dict(checked_devices(declared, path.parent, problems))
    try:
        sections = RigSections.model_validate(tree)
    except ValidationError as error:
        problems = validation_problems(error, ()) + problems
        sections = RigSections.model_construct(**valid_sections(tree))
    rig_file = RigFile(path, text, sections, devices)
    names = frozenset(declared if isinstance(declared, Mapping) else ())
    problems += reference_problems(rig_file, names)
    if problems:
        raise RigFileError("\n".join(f"{path}: {problem}" for problem in problems))
    return rig_file


def valid_sections(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sections of a rig file by name. The value of an invalid section is None.

    `tree` is the parsed TOML file without the section `[devices]`. With the result, the caller can
    check the names by which one section refers to another section.
    """
    sections = {}
    for name, part in RigSections.model_fields.items():
        try:
            sections[name] = TypeAdapter(part.rebuild_annotation()).validate_python(tree.get(name))
        except ValidationError:
            sections[name] = None
    return sections


@cache
def device_validator(settings: type[DeviceSettings]) -> TypeAdapter[DeviceSettings]:
    """Return pydantic's validator for a class of device settings.

    The validator is created at the first call with this class, and is stored for later calls.
    """
    return TypeAdapter(settings)


def checked_devices(
    tree: Any, folder: Path, problems: list[str]
) -> Iterator[tuple[str, DeviceSettings]]:
    """Yield the name and the settings of each device whose section is valid."""
    if not isinstance(tree, Mapping) or not tree:
        problems.append("devices: expected a section [devices.NAME] for each device")
        return
    for name, section in tree.items():
        kind = section.get("kind") if isinstance(section, Mapping) else None
        if kind not in kinds():
            problems.append(f"devices.{name}.kind: {kind!r}: expected one of {', '.join(kinds())}")
            continue
        try:
            validator = device_validator(device_class(kind).Settings)
            yield name, validator.validate_python(section, context={"folder": folder})
        except ValidationError as error:
            problems += validation_problems(error, ("devices", name))
        except ImportError as error:
            problems.append(f"devices.{name}.kind: {kind} needs a package: {error}")
        except ValueError as error:
            problems.append(f"devices.{name}.kind: {error}")


def validation_problems(error: ValidationError, where: tuple[str, ...]) -> list[str]:
    """Return one line of text per problem that pydantic found, with the key and the given value."""
    return [
        f"{'.'.join(map(str, where + part['loc']))}: {value_problem(part)}"
        for part in error.errors()
    ]


def reference_problems(rig: RigFile, declared: frozenset[str]) -> Iterator[str]:
    """Yield the problems of the references between sections of a rig file.

    A reference is the name of a bus, device, signal or drive. Examples of problems are an unknown
    name, and a drive or CAN identifier that is used twice. Another problem is a missing scale: a
    channel needs a scale if its signal is not in the SI unit of the channel.
    """
    try:
        devices = rig.make_devices()
    except (ValueError, OSError) as error:
        yield str(error)
        return
    sections = rig.sections
    for name, device in devices.items():
        if isinstance(device, DerivedDevice):
            try:
                device.start(devices)
            except RigError as error:
                yield f"devices.{name}: {str(error).removeprefix(f'{name}: ')}"
    if sections.buses is not None:
        yield from bus_problems(devices, sections.buses)
    if sections.channels is not None:
        for name, channel in sections.channels.items():
            problem = channel_problem(name, channel, devices)
            if problem and channel.device not in declared - devices.keys():
                yield f"channels.{name}.{problem}"
    if sections.drives is not None:
        for name, drive in sections.drives.items():
            problem = drive_problem(drive, devices)
            if problem:
                if drive.device not in declared - devices.keys():
                    yield f"drives.{name}.{problem}"
            elif sections.channels is not None:
                for problem in axis_problems(name, rig, devices):
                    yield f"drives.{name}{problem}"
        slave, master = sections.drives.slave, sections.drives.master
        yield from side_problems(sections)
        if slave and master and master.device == slave.device in devices:
            names = {sole_drive(devices[slave.device], one.drive) for one in (master, slave)}
            if len(names) == 1 and "" not in names:
                yield "drives.master: same drive as drives.slave: expected another drive"


def side_problems(sections: RigSections) -> Iterator[str]:
    """Yield the problems of a rig that has no complete slave.

    A rig without drives.slave is the master side of a telemanipulator on two computers.
    """
    if sections.drives.slave is None and sections.drives.master is None:
        yield (
            "drives: expected drives.slave, or drives.master in the rig file of the master side of "
            "two stations"
        )
    channels = sections.channels
    if channels is None:
        return
    for name in ("contact_force", "slave_position"):
        if sections.drives.slave and getattr(channels, name) is None:
            yield f"channels.{name}: missing: expected it for the slave"
        elif not sections.drives.slave and getattr(channels, name):
            yield f"channels.{name}: the rig has no drives.slave: expected no such channel"


def bus_problems(
    devices: Mapping[str, Device], buses: Mapping[str, AnyBusSettings]
) -> Iterator[str]:
    """Yield texts on problems: unknown buses of devices, ports or CAN identifiers used twice."""
    ports: dict[str, str] = {}
    for name, settings in buses.items():
        own = [settings.address]
        if isinstance(settings, UdpSettings) and settings.local_port:
            own.append(f"local UDP port {settings.local_host}:{settings.local_port}")
        for port in own:
            if ports.setdefault(port, name) != name:
                yield f"buses.{name}: {port!r} is already used by bus {ports[port]}"
    users: dict[str, list[str]] = {}
    senders: dict[tuple[str, int], str] = {}
    for name, device in devices.items():
        kinds = next((kinds for base, kinds in BUS_KINDS.items() if isinstance(device, base)), ())
        if not kinds:
            continue
        bus = device.settings.bus
        fitting = [other for other, settings in buses.items() if settings.kind in kinds]
        if bus not in fitting:
            yield (
                f"devices.{name}.bus: {bus!r}: expected a {' or '.join(kinds)} bus of the section "
                f"[buses]: {', '.join(fitting) or 'there is none'}"
            )
        elif isinstance(device, CanDevice):
            if device.needs_fd and not getattr(buses[bus], "fd", False):
                yield f"devices.{name}.bus: {bus!r}: expected a bus with fd = true"
            for identifier in device.identifiers():
                other = senders.setdefault((bus, identifier), name)
                if other != name:
                    yield (
                        f"devices.{name}: identifier {identifier:#x} on {bus} is already used by "
                        f"device {other}"
                    )
                    break
        else:
            others = users.setdefault(bus, [])
            if problem := sharing_problem(device, [devices[other] for other in others]):
                yield f"devices.{name}.bus: {problem}"
            others.append(name)


def sharing_problem(device: Device, others: list[Device]) -> str | None:
    """Return why a device cannot have the same port as other devices; None if it can."""
    for other in others:
        taken = f"{device.settings.bus!r} is already used by device {other.name}"
        if not isinstance(device, SharedSerialDevice) or type(other) is not type(device):
            return f"port {taken}"
        if other.address == device.address:
            return f"address {device.address} on {taken}"
    return None


def channel_problem(
    name: str, channel: MeasurementSettings, devices: Mapping[str, Device]
) -> str | None:
    """Check that the device and signal of a channel exist, and that no needed scale is missing.

    Return a text that describes the problem, or None if there is no problem.
    """
    if channel.device not in devices:
        return f"device: {channel.device!r}: expected one of {', '.join(devices)}"
    units = devices[channel.device].signals()
    if channel.signal not in units:
        return f"signal: {channel.signal!r}: expected one of {', '.join(units)}"
    if units[channel.signal] != UNITS[name] and channel.scale is None:
        unit = units[channel.signal]
        return f"scale: missing: the signal is in {unit}, expected {UNITS[name]}/{unit}"
    return None


def drive_problem(drive: DriveSettings, devices: Mapping[str, Device]) -> str | None:
    """Check that the device and the drive that a section of the rig file names exist.

    Return a text that describes the problem, or None if there is no problem.
    """
    if drive.device not in devices:
        return f"device: {drive.device!r}: expected one of {', '.join(devices)}"
    if not sole_drive(devices[drive.device], drive.drive):
        names = ", ".join(devices[drive.device].drives) or "it has none"
        return f"drive: {drive.drive!r}: expected a drive of the device: {names}"
    return None


ROUNDING = 0.05
"""Largest relative error with which a drive may apply a gain of a coupling."""
FOR_FORCES = (
    "max_force_n",
    "stiffness_n_per_m",
    "damping_ns_per_m",
    "friction_ns_per_m",
    "moving_mass_kg",
    "latency_ticks",
    "drive_rate_hz",
    "handle_mass_kg",
)
"""Keys of a drive that accepts forces or closes a coupling itself."""


def axis_problems(name: str, rig: RigFile, devices: Mapping[str, Device]) -> Iterator[str]:
    """Yield the problems of a section of a drive that depend on the kind of the drive.

    A virtual coupling must be passive: only then is it stable with every hand, also released.
    """
    settings = getattr(rig.sections.drives, name)
    device = devices[settings.device]
    drive = device.drives[sole_drive(device, settings.drive)]
    given = settings.model_fields_set
    period = 1.0 / (rig.sections.rate_hz or USUAL_RATE)  # None if the rate is invalid
    coupling = coupling_of(settings, period)
    if not isinstance(drive, ForceDrive | ImpedanceDrive):
        accepts = "positions" if isinstance(drive, PositionDrive) else "velocities"
        for key in FOR_FORCES:
            if key in given:
                yield f".{key}: the drive accepts {accepts}: expected no such key"
    elif settings.max_force_n is None:
        yield ".max_force_n: missing: the drive accepts forces"
    elif (settings.stiffness_n_per_m is None) == (settings.moving_mass_kg is None):
        yield (
            ": expected stiffness_n_per_m, for a virtual coupling, or moving_mass_kg, for a "
            "velocity loop"
        )
    elif rig.sections.channels.position_of(name) is None:
        yield f": expected the channel {name}_position, because the drive accepts forces"
    elif settings.drive_rate_hz and not isinstance(drive, ImpedanceDrive):
        yield ".drive_rate_hz: the host closes the coupling of this drive: expected no such key"
    elif coupling:
        if isinstance(drive, ImpedanceDrive):
            coupling = replace(coupling, drive_period=1.0 / (settings.drive_rate_hz or drive.rate))
            yield from rounding_problems(drive, coupling)
        if settings.stiffness_n_per_m is not None and (bad := coupling.problem(period)):
            yield f".stiffness_n_per_m: {bad}"
    if name == "slave" and settings.handle_mass_kg and isinstance(drive, ForceDrive):
        yield ".handle_mass_kg: the slave has no handle: expected it in drives.master"
    if drive.signal and drive.signal not in device.signals():
        yield f".device: expected a signal {drive.signal} of the device {device.name}"


def rounding_problems(drive: ImpedanceDrive, coupling: CouplingParameters) -> Iterator[str]:
    """Yield a text for each gain that the drive applies with a large rounding error."""
    stiffness, damping = drive.rounded(coupling.stiffness, coupling.damping)
    for key, wanted, found, unit in (
        ("stiffness_n_per_m", coupling.stiffness, stiffness, "N/m"),
        ("damping_ns_per_m", coupling.damping, damping, "N s/m"),
    ):
        if abs(found - wanted) > ROUNDING * wanted:
            yield (
                f": {key} of {wanted:.4g} {unit}: the motor would apply {found:.4g} {unit}: "
                f"expected a value that it can apply with an error of at most {ROUNDING:.0%}"
            )
