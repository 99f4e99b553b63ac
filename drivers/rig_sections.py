"""Sections of a rig file. Names contain the unit; unknown keys are errors."""

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
    """Rig file section of a serial port."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    baud_bps: Annotated[int, Field(gt=0)]


class CanSettings(Section):
    """Rig file section of a CAN bus with any adapter that python-can supports."""

    kind: Literal["can"]
    interface: str
    channel: Annotated[str, Field(min_length=1)]
    bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    options: dict[str, Any] = {}


BusSettings = Annotated[SerialSettings | CanSettings, Field(discriminator="kind")]


class ChannelSettings(Section):
    """Source of a channel: value in SI units = sign * scale * signal + offset."""

    device: str
    signal: str
    scale: Positive | None = None
    """SI unit per unit of the signal, for example N/V; not needed for a signal in SI units."""
    sign: Literal[1, -1] = 1
    lag_ms: NonNegative = 0.0
    """Delay from the sampling of a value to its arrival."""
    max_age_ms: Positive = 20.0
    """Age of a sample above which the rig is stopped."""

    @property
    def gain(self) -> float:
        """Signed scale: SI unit of the channel per unit of the signal."""
        return self.sign * (self.scale or 1.0)


class ForceSettings(ChannelSettings):
    """Rig file section of a force channel."""

    offset_n: FiniteFloat = 0.0
    range_n: tuple[FiniteFloat, FiniteFloat]
    max_rate_n_per_s: Positive | None = None
    frozen_ms: Positive | None = None
    """Longest time in which a working sensor repeats exactly the same value."""

    @property
    def offset(self) -> float:
        """Offset [N]."""
        return self.offset_n


class PositionSettings(ChannelSettings):
    """Rig file section of a position channel."""

    offset_mm: FiniteFloat = 0.0
    range_mm: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s: Positive | None = None
    frozen_travel_mm: Positive | None = None
    """Largest commanded displacement without a change of the measured position."""
    resolution_um: Positive = 1.0
    """Position of one encoder count."""

    @property
    def offset(self) -> float:
        """Offset [m]."""
        return self.offset_mm * 1e-3


class VelocitySettings(ChannelSettings):
    """Rig file section of a velocity channel."""

    range_mm_per_s: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s2: Positive | None = None
    frozen_travel_mm_per_s: Positive | None = None

    @property
    def offset(self) -> float:
        """Offset [m/s]."""
        return 0.0


class ChannelsSettings(Section):
    """Rig file section of the channels.

    The encoder of the handle and the velocity of the slave are optional.
    """

    master_force: ForceSettings
    contact_force: ForceSettings
    slave_position: PositionSettings
    master_position: PositionSettings | None = None
    slave_velocity: VelocitySettings | None = None

    def items(self) -> Iterator[tuple[str, ForceSettings | PositionSettings | VelocitySettings]]:
        """Yield the channels of the rig, by name, in the order of `drivers.CHANNELS`."""
        for name in CHANNELS:
            if channel := getattr(self, name):
                yield name, channel


class DriveSettings(Section):
    """Rig file section of a drive."""

    device: str
    drive: str = ""
    """Name of the drive; needed only if the device has several."""
    sign: Literal[1, -1] = 1
    max_velocity_mm_per_s: Positive


class DrivesSettings(Section):
    """Rig file section of the drives. Without a drive for the master, the handle is passive."""

    slave: DriveSettings
    master: DriveSettings | None = None

    def items(self) -> Iterator[tuple[str, DriveSettings]]:
        """Yield the drives of the rig, by name, in the order of `drivers.Command`."""
        for name in AXES:
            if drive := getattr(self, name):
                yield name, drive


class LimitsSettings(Section):
    """Rig file section of the safety limits; see `teleop.safety.Limits` for each."""

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
    """All sections of a rig file except those of the devices, which depend on their kinds."""

    name: Annotated[str, Field(min_length=1)]
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=100_000)] = 1000.0
    buses: Annotated[dict[str, BusSettings], Field(min_length=1)]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings
