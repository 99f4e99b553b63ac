"""Define the sections of a rig file. Names of keys end with the unit. Unknown keys are errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from drivers.rig import AXES, CHANNELS

Positive = Annotated[FiniteFloat, Field(gt=0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]


class Section(BaseModel):
    """Base class of the sections of a rig file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SerialSettings(Section):
    """Section of the rig file for a serial port."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    baud_bps: Annotated[int, Field(gt=0)]


class CanSettings(Section):
    """Section of the rig file for a CAN bus, with any adapter that python-can supports."""

    kind: Literal["can"]
    interface: str
    channel: Annotated[str, Field(min_length=1)]
    bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    options: dict[str, Any] = {}


BusSettings = Annotated[SerialSettings | CanSettings, Field(discriminator="kind")]


class ChannelSettings(Section):
    """Section of the rig file for a channel.

    The value of the channel is computed from a signal of a device. In SI units, the value is
    sign * scale * signal + offset.
    """

    device: str
    signal: str
    scale: Positive | None = None
    """Scale of the signal, for example in N/V. Not needed for a signal in the channel's SI unit."""
    sign: Literal[1, -1] = 1
    lag_ms: NonNegative = 0.0
    """Delay of the sensor, which is added to the age of each sample [ms]."""
    max_age_ms: Positive = 20.0
    """Largest age of a sample [ms]. If a sample is older, the rig is stopped."""

    @property
    def gain(self) -> float:
        """Scale times sign [SI unit of the channel per unit of the signal]."""
        return self.sign * (self.scale or 1.0)


class ForceSettings(ChannelSettings):
    """Section of the rig file for a channel that measures a force."""

    offset_n: FiniteFloat = 0.0
    range_n: tuple[FiniteFloat, FiniteFloat]
    max_rate_n_per_s: Positive | None = None
    frozen_ms: Positive | None = None
    """Longest time during which a working sensor gives exactly the same value [ms]."""

    @property
    def offset(self) -> float:
        """Offset of the channel [N]."""
        return self.offset_n


class PositionSettings(ChannelSettings):
    """Section of the rig file for a channel that measures a position."""

    offset_mm: FiniteFloat = 0.0
    range_mm: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s: Positive | None = None
    frozen_travel_mm: Positive | None = None
    """Largest commanded displacement during which a working encoder gives the same value [mm]."""
    resolution_um: Positive = 1.0
    """Displacement per encoder count [um]."""

    @property
    def offset(self) -> float:
        """Offset of the channel [m]."""
        return self.offset_mm * 1e-3


class VelocitySettings(ChannelSettings):
    """Section of the rig file for a channel that measures a velocity."""

    range_mm_per_s: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s2: Positive | None = None
    frozen_travel_mm_per_s: Positive | None = None
    """Largest commanded velocity change for which a working sensor gives the same value [mm/s]."""

    @property
    def offset(self) -> float:
        """Offset of the channel [m/s]; always zero."""
        return 0.0


class ChannelsSettings(Section):
    """Section of the rig file for all channels.

    The position of the handle and the velocity of the slave are optional.
    """

    master_force: ForceSettings
    contact_force: ForceSettings
    slave_position: PositionSettings
    master_position: PositionSettings | None = None
    slave_velocity: VelocitySettings | None = None

    def items(self) -> Iterator[tuple[str, ForceSettings | PositionSettings | VelocitySettings]]:
        """Yield the name and settings of each channel of the rig, in the order of `CHANNELS`."""
        for name in CHANNELS:
            if channel := getattr(self, name):
                yield name, channel


class DriveSettings(Section):
    """Section of the rig file for the drive of the master or of the slave."""

    device: str
    drive: str = ""
    """Name of the drive in its device. Needed only if the device has several drives."""
    sign: Literal[1, -1] = 1
    max_velocity_mm_per_s: Positive


class DrivesSettings(Section):
    """Section of the rig file for the drives. If the master has no drive, the handle is passive."""

    slave: DriveSettings
    master: DriveSettings | None = None

    def items(self) -> Iterator[tuple[str, DriveSettings]]:
        """Yield the name and settings of each drive, in the order of `drivers.Command`."""
        for name in AXES:
            if drive := getattr(self, name):
                yield name, drive


class LimitsSettings(Section):
    """Section of the rig file for the safety limits. See `teleop.safety.Limits`."""

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
    """All sections of a rig file except the sections of devices.

    The keys in the section of a device depend on the kind of the device.
    """

    name: Annotated[str, Field(min_length=1)]
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=100_000)] = 1000.0
    buses: Annotated[dict[str, BusSettings], Field(min_length=1)]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings
