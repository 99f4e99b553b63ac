"""A rig file: which device gives which channel and moves which drive, over which bus.

TOML, with units in the names and unknown keys refused; all that is wrong is told at once.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, ValidationError

from drivers.device import CanDevice, Device, DeviceSettings, SerialDevice, sole_drive
from drivers.registry import device_class, kinds
from drivers.rig import CHANNELS

Positive = Annotated[FiniteFloat, Field(gt=0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]


class RigFileError(ValueError):
    """A rig file is not as expected; its message names the file and everything wrong in it."""


class Section(BaseModel):
    """A section of a rig file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SerialSettings(Section):
    """A serial port."""

    kind: Literal["serial"]
    port: str
    baud_bps: Annotated[int, Field(gt=0)]


class CanSettings(Section):
    """A CAN bus behind any adapter that python-can knows."""

    kind: Literal["can"]
    interface: str
    channel: str
    bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    options: dict[str, Any] = {}


BusSettings = Annotated[SerialSettings | CanSettings, Field(discriminator="kind")]


class ChannelSettings(Section):
    """Where a channel comes from: SI value = sign * scale * signal + offset."""

    device: str
    signal: str
    scale: Positive | None = None
    """SI unit for a unit of the signal, such as N per V; not needed for a signal in SI units."""
    sign: Literal[1, -1] = 1
    lag_ms: NonNegative = 0.0
    """How long before its arrival a sample was taken."""
    max_age_ms: Positive = 20.0


class ForceSettings(ChannelSettings):
    """A force channel."""

    offset_n: FiniteFloat = 0.0
    range_n: tuple[FiniteFloat, FiniteFloat]
    max_rate_n_per_s: Positive | None = None
    frozen_ms: Positive | None = None
    """Longest time for which the live sensor repeats one value to the bit."""

    @property
    def offset(self) -> float:
        """In newtons."""
        return self.offset_n


class PositionSettings(ChannelSettings):
    """A position channel."""

    offset_mm: FiniteFloat = 0.0
    range_mm: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s: Positive | None = None
    frozen_travel_mm: Positive | None = None
    """Farthest that the drive is commanded to go without any change of the value."""
    resolution_um: Positive = 1.0
    """One count of the encoder."""

    @property
    def offset(self) -> float:
        """In metres."""
        return self.offset_mm * 1e-3


class VelocitySettings(ChannelSettings):
    """A velocity channel."""

    range_mm_per_s: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s2: Positive | None = None
    frozen_travel_mm_per_s: Positive | None = None

    @property
    def offset(self) -> float:
        """In metres a second."""
        return 0.0


class ChannelsSettings(Section):
    """The channels; a rig without encoder at the handle, or whose drive reports no velocity."""

    master_force: ForceSettings
    contact_force: ForceSettings
    slave_position: PositionSettings
    master_position: PositionSettings | None = None
    slave_velocity: VelocitySettings | None = None

    def items(self) -> Iterator[tuple[str, ForceSettings | PositionSettings | VelocitySettings]]:
        """The channels that the rig has, by name, in the order of `drivers.CHANNELS`."""
        for name in CHANNELS:
            if channel := getattr(self, name):
                yield name, channel


class DriveSettings(Section):
    """A drive of the rig."""

    device: str
    drive: str = ""
    """Which of the device's drives, where it has several."""
    sign: Literal[1, -1] = 1
    max_velocity_mm_per_s: Positive


class DrivesSettings(Section):
    """The drives; without one for the master the handle is passive."""

    slave: DriveSettings
    master: DriveSettings | None = None

    def items(self) -> Iterator[tuple[str, DriveSettings]]:
        """The drives that the rig has, in the order of `drivers.Command`."""
        for name in ("master", "slave"):
            if drive := getattr(self, name):
                yield name, drive


class LimitsSettings(Section):
    """What the telemanipulator may do; `teleop.safety.Limits` tells each."""

    max_velocity_mm_per_s: Positive
    max_acceleration_m_per_s2: Positive
    max_master_velocity_mm_per_s: Positive
    max_master_acceleration_m_per_s2: Positive
    soft_position_mm: tuple[FiniteFloat, FiniteFloat]
    hard_position_mm: tuple[FiniteFloat, FiniteFloat]
    soft_force_n: Positive
    hard_force_n: Positive
    following_error_mm: Positive
    drive_compliance_um_per_n: NonNegative = 0.0
    rest_velocity_mm_per_s: Positive = 2.0
    rest_master_force_n: Positive = 5.0


class RigSections(Section):
    """All of a rig file but its devices, whose sections depend on their kinds."""

    name: str
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=1000)] = 1000.0
    buses: dict[str, BusSettings]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings


@dataclass(frozen=True)
class RigFile:
    """A rig file that has been read and checked."""

    path: Path
    text: str
    """As it stands."""
    sections: RigSections
    devices: dict[str, DeviceSettings] = field(default_factory=dict)

    def make_devices(self) -> dict[str, Device]:
        """Fresh devices by name, not started."""
        return {
            name: device_class(settings.kind)(name, settings)
            for name, settings in self.devices.items()
        }


def read_rig_file(path: Path) -> RigFile:
    """Read and check a rig file.

    Raises
    ------
    OSError
        It cannot be read.
    RigFileError
        It is not as expected.
    """
    raw = path.read_bytes()
    try:
        text = raw.decode()
        tree = tomllib.loads(text)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RigFileError(f"{path}: not a TOML file: {error}") from error
    problems: list[str] = []
    devices = dict(checked_devices(tree.pop("devices", {}), path.parent, problems))
    try:
        sections = RigSections.model_validate(tree)
    except ValidationError as error:
        problems = told(error, ()) + problems
    else:
        rig_file = RigFile(path, text, sections, devices)
        if not problems:
            problems = list(loose_ends(rig_file))
        if not problems:
            return rig_file
    raise RigFileError("\n".join(f"{path}: {problem}" for problem in problems))


def checked_devices(
    tree: Any, folder: Path, problems: list[str]
) -> Iterator[tuple[str, DeviceSettings]]:
    """Each device's section, checked by its kind; what is wrong goes to `problems`."""
    if not isinstance(tree, Mapping) or not tree:
        problems.append("devices: expected a section [devices.NAME] for each device")
        return
    for name, section in tree.items():
        kind = section.get("kind") if isinstance(section, Mapping) else None
        if kind not in kinds():
            problems.append(f"devices.{name}.kind: {kind!r}: expected one of {', '.join(kinds())}")
            continue
        try:
            settings = device_class(kind).Settings
            yield name, TypeAdapter(settings).validate_python(section, context={"folder": folder})
        except ValidationError as error:
            problems += told(error, ("devices", name))
        except ImportError as error:
            problems.append(f"devices.{name}.kind: {kind} needs a package: {error}")


def told(error: ValidationError, where: tuple[str, ...]) -> list[str]:
    """What pydantic found, each with its path."""
    return [
        f"{'.'.join(map(str, where + part['loc']))}: {part['msg'].lower()}"
        + ("" if isinstance(part["input"], Mapping) else f", got {part['input']!r}")
        for part in error.errors()
    ]


def loose_ends(rig: RigFile) -> Iterator[str]:
    """References that lead nowhere, and signals that do not fit."""
    try:
        devices = rig.make_devices()
    except (ValueError, OSError) as error:
        yield str(error)
        return
    buses = rig.sections.buses
    kind_of = {name: bus.kind for name, bus in buses.items()}
    taken: dict[str, str] = {}
    for name, device in devices.items():
        wanted = {SerialDevice: "serial", CanDevice: "can"}
        kind = next((bus for base, bus in wanted.items() if isinstance(device, base)), None)
        if not kind:
            continue
        bus = getattr(device.settings, "bus", None)
        fitting = [other for other in buses if kind_of[other] == kind]
        if bus not in fitting:
            yield (
                f"devices.{name}.bus: {bus!r}: expected a {kind} bus of the section [buses]: "
                f"{', '.join(fitting) or 'there is none'}"
            )
        elif kind == "serial" and taken.setdefault(bus, name) != name:
            yield f"devices.{name}.bus: port {bus!r} is that of {taken[bus]} already"
    for name, channel in rig.sections.channels.items():
        where = f"channels.{name}"
        if channel.device not in devices:
            yield f"{where}.device: {channel.device!r}: expected one of {', '.join(devices)}"
            continue
        units = devices[channel.device].signals()
        if channel.signal not in units:
            yield f"{where}.signal: {channel.signal!r}: expected one of {', '.join(units)}"
        elif (unit := units[channel.signal]) != UNITS[name] and channel.scale is None:
            yield f"{where}.scale: missing: the signal is in {unit}, expected {UNITS[name]}/{unit}"
    for name, drive in rig.sections.drives.items():
        where = f"drives.{name}"
        if drive.device not in devices:
            yield f"{where}.device: {drive.device!r}: expected one of {', '.join(devices)}"
        elif not sole_drive(devices[drive.device], drive.drive):
            names = ", ".join(devices[drive.device].drives) or "none: it moves nothing"
            yield f"{where}.drive: {drive.drive!r}: expected one of those of the device: {names}"


UNITS = {
    "master_force": "N",
    "master_position": "m",
    "slave_position": "m",
    "contact_force": "N",
    "slave_velocity": "m/s",
}
"""SI unit of each channel."""
