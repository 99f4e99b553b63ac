"""Define the sections of a rig file, a TOML file that describes a telemanipulator.

The key of a physical quantity ends with its unit, for example `lag_ms`. Unknown keys are errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from drivers.rig import AXES, CHANNELS

Positive = Annotated[FiniteFloat, Field(gt=0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]
UpTo1 = Annotated[FiniteFloat, Field(ge=0, le=1)]
UpTo500 = Annotated[FiniteFloat, Field(ge=0, le=500)]
UpTo10000 = Annotated[FiniteFloat, Field(ge=0, le=10_000)]


class Section(BaseModel):
    """Base class of the sections of a rig file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SerialSettings(Section):
    """Section `[buses.NAME]` of a rig file, for a serial port."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    baud_bps: Annotated[int, Field(gt=0)]


class CanSettings(Section):
    """Section `[buses.NAME]` of a rig file, for a CAN bus.

    Every CAN adapter that python-can supports can be used.
    """

    kind: Literal["can"]
    interface: str
    channel: Annotated[str, Field(min_length=1)]
    bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    options: dict[str, Any] = {}


BusSettings = Annotated[SerialSettings | CanSettings, Field(discriminator="kind")]


class MeasurementSettings(Section):
    """Section of a rig file for one channel.

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
        """Product of sign and scale, which is multiplied by the signal of the device.

        The unit is the SI unit of the channel, divided by the unit of the signal.
        """
        return self.sign * (self.scale or 1.0)


class ForceSettings(MeasurementSettings):
    """Section of a rig file for a channel that measures a force."""

    offset_n: FiniteFloat = 0.0
    range_n: tuple[FiniteFloat, FiniteFloat]
    max_rate_n_per_s: Positive | None = None
    frozen_ms: Positive | None = None
    """Longest time during which a working sensor gives exactly the same value [ms]."""

    @property
    def offset(self) -> float:
        """Offset of the measured force [N]. The force is gain * signal + offset."""
        return self.offset_n


class PositionSettings(MeasurementSettings):
    """Section of a rig file for a channel that measures a position."""

    offset_mm: FiniteFloat = 0.0
    range_mm: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s: Positive | None = None
    frozen_travel_mm: Positive | None = None
    """Largest commanded displacement during which a working encoder gives the same value [mm]."""
    resolution_um: Positive = 1.0
    """Smallest displacement that the encoder can measure [um]."""

    @property
    def offset(self) -> float:
        """Offset of the measured position [m]. The position is gain * signal + offset."""
        return self.offset_mm * 1e-3


class VelocitySettings(MeasurementSettings):
    """Section of a rig file for a channel that measures a velocity."""

    range_mm_per_s: tuple[FiniteFloat, FiniteFloat]
    max_rate_mm_per_s2: Positive | None = None
    frozen_travel_mm_per_s: Positive | None = None
    """Largest commanded velocity change for which a working sensor gives the same value [mm/s]."""

    @property
    def offset(self) -> float:
        """Offset of the measured velocity [m/s]. It is always zero."""
        return 0.0


class ChannelsSettings(Section):
    """Section `[channels]` of a rig file: the settings of all channels.

    The position of the handle (`master_position`) and the velocity of the slave
    (`slave_velocity`) are optional.
    """

    master_force: ForceSettings
    contact_force: ForceSettings
    slave_position: PositionSettings
    master_position: PositionSettings | None = None
    slave_velocity: VelocitySettings | None = None

    def items(self) -> Iterator[tuple[str, ForceSettings | PositionSettings | VelocitySettings]]:
        """Yield the name and settings of each channel that the rig file contains.

        The order is that of `drivers.CHANNELS`.
        """
        for name in CHANNELS:
            if channel := getattr(self, name):
                yield name, channel


class DriveSettings(Section):
    """Section of a rig file for one drive: the drive of the master or of the slave."""

    device: str
    drive: str = ""
    """Name of the drive in its device. Needed only if the device has several drives."""
    sign: Literal[1, -1] = 1
    max_velocity_mm_per_s: Positive


class DrivesSettings(Section):
    """Section `[drives]` of a rig file: the settings of the drives of slave and master.

    The drive of the master is optional. Without this drive, the handle is passive.
    """

    slave: DriveSettings
    master: DriveSettings | None = None

    def items(self) -> Iterator[tuple[str, DriveSettings]]:
        """Yield the name and settings of each drive: first `master`, if given, then `slave`."""
        for name in AXES:
            if drive := getattr(self, name):
                yield name, drive


class LimitsSettings(Section):
    """Section `[limits]` of a rig file: the safety limits of the rig.

    The class `teleop.safety.Limits` explains the limits.
    """

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


class TransmissionSettings(Section):
    """Section `[transmission]` of a rig file, or a file of its own, written by `teleop lag`.

    It states how encoder and tip of the slave differ. An error is the half width of a 95 %
    interval.
    """

    lag_ms: UpTo500 = 0.0
    """Lag of the force that remains in the recordings. It is not the delay
    `channels.contact_force.lag_ms`, by which the recorded samples are shifted."""
    lag_error_ms: UpTo500 = 0.0
    delay_share: UpTo1 = 0.0
    """Share of a pure delay in this lag; the rest is a lag of first order."""
    delay_share_error: UpTo1 = 0.0
    lost_motion_um: UpTo10000 = 0.0
    """Half width of the play between encoder and tip."""
    lost_motion_error_um: UpTo10000 = 0.0
    lag_lost_motion_correlation: Annotated[FiniteFloat, Field(ge=-1, le=1)] = 0.0
    """Correlation of the errors of lag and lost motion."""
    compliance_um_per_n: UpTo10000 = 0.0
    compliance_error_um_per_n: UpTo10000 = 0.0


class RigSections(Section):
    """All sections of a rig file except the sections of devices.

    The sections of devices are checked separately, because their keys depend on the kind of the
    device.
    """

    name: Annotated[str, Field(min_length=1)]
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=100_000)] = 1000.0
    buses: Annotated[dict[str, BusSettings], Field(min_length=1)]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings
    transmission: TransmissionSettings | None = None
