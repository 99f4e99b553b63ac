"""The sections of a rig file; units stand in the names, and unknown keys are refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from drivers.rig import AXES, CHANNELS

Positive = Annotated[FiniteFloat, Field(gt=0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]


class Section(BaseModel):
    """A section of a rig file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SerialSettings(Section):
    """A serial port."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    baud_bps: Annotated[int, Field(gt=0)]


class CanSettings(Section):
    """A CAN bus behind any adapter that python-can knows."""

    kind: Literal["can"]
    interface: str
    channel: Annotated[str, Field(min_length=1)]
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

    @property
    def gain(self) -> float:
        """The channel's SI unit for a unit of the signal, signed."""
        return self.sign * (self.scale or 1.0)


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
        for name in AXES:
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

    name: Annotated[str, Field(min_length=1)]
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=1000)] = 1000.0
    buses: Annotated[dict[str, BusSettings], Field(min_length=1)]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings
