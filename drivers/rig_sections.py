"""Define the sections of a rig file, a TOML file that describes a telemanipulator.

The key of a physical quantity ends with its unit, for example `lag_ms`. Unknown keys are errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from drivers.coupling import CouplingParameters, velocity_loop
from drivers.rig import AXES, CHANNELS

Positive = Annotated[FiniteFloat, Field(gt=0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]
UpTo1 = Annotated[FiniteFloat, Field(ge=0, le=1)]
UpTo500 = Annotated[FiniteFloat, Field(ge=0, le=500)]
PortNumber = Annotated[int, Field(ge=1, le=65_535)]
USUAL_RATE = 1000.0
"""Rate of the control loop if the rig file states none [Hz]."""
UpTo10000 = Annotated[FiniteFloat, Field(ge=0, le=10_000)]


class Section(BaseModel):
    """Base class of the sections of a rig file."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SerialSettings(Section):
    """Section `[buses.NAME]` of a rig file, for a serial port."""

    kind: Literal["serial"]
    port: Annotated[str, Field(min_length=1)]
    baud_bps: Annotated[int, Field(gt=0)]

    @property
    def address(self) -> str:
        """Text that no other bus may have."""
        return self.port


class CanSettings(Section):
    """Section `[buses.NAME]` of a rig file, for a CAN bus.

    Every CAN adapter that python-can supports can be used.
    """

    kind: Literal["can"]
    interface: str
    channel: Annotated[str, Field(min_length=1)]
    bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    fd: bool = False
    """Whether the bus has CAN FD: up to 64 bytes per frame, and a higher bit rate of the data."""
    data_bitrate_bps: Annotated[int, Field(gt=0)] | None = None
    """Bit rate of the data of a CAN FD frame."""
    options: dict[str, Any] = {}

    @model_validator(mode="after")
    def _check_fd(self) -> Self:
        if self.fd and self.interface == "slcan":
            raise ValueError("fd = true: the interface slcan has no CAN FD: expected another one")
        if self.data_bitrate_bps and not self.fd:
            raise ValueError("data_bitrate_bps: expected only with fd = true")
        return self

    @property
    def address(self) -> str:
        """Text that no other bus may have."""
        return self.channel


class TcpSettings(Section):
    """Section `[buses.NAME]` of a rig file, for a TCP connection to a device or serial server."""

    kind: Literal["tcp"]
    host: Annotated[str, Field(min_length=1)]
    port: PortNumber
    baud_bps: Annotated[int, Field(gt=0)] | None = None
    """Rate of the serial line of a serial server."""

    @property
    def address(self) -> str:
        """Text that no other bus may have."""
        return f"TCP port {self.host}:{self.port}"


class UdpSettings(Section):
    """Section `[buses.NAME]` of a rig file, for UDP datagrams to and from a device."""

    kind: Literal["udp"]
    host: Annotated[str, Field(min_length=1)]
    port: PortNumber
    local_host: str = ""
    """Address of the network interface of this computer; empty for any interface."""
    local_port: PortNumber | None = None
    """Port of this computer; None for any free port."""

    @property
    def address(self) -> str:
        """Text that no other bus may have."""
        return f"UDP port {self.host}:{self.port}"


AnyBusSettings = SerialSettings | CanSettings | TcpSettings | UdpSettings
BusSettings = Annotated[AnyBusSettings, Field(discriminator="kind")]


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

    Without `master_force`, the force of the hand is that of the virtual coupling of the master's
    drive. A rig without this channel and without this drive has no handle. Only the master side of
    a telemanipulator on two computers has no contact force and no position of the slave.
    """

    contact_force: ForceSettings | None = None
    slave_position: PositionSettings | None = None
    master_force: ForceSettings | None = None
    master_position: PositionSettings | None = None
    slave_velocity: VelocitySettings | None = None

    def position_of(self, axis: str) -> PositionSettings | None:
        """Return the channel with the position of an axis (`master`, `slave`)."""
        return self.master_position if axis == "master" else self.slave_position

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
    lag_ms: UpTo500 = 0.0
    """Lag with which the drive follows its command [ms]."""
    latency_ticks: Annotated[int, Field(ge=0, le=20)] = 1
    """Whole periods from a measurement to the force of the drive that is computed from it."""
    max_force_n: Positive | None = None
    """Greatest force of the drive. Needed for a drive that accepts forces."""
    stiffness_n_per_m: Positive | None = None
    """Stiffness of the virtual coupling of a drive that accepts forces."""
    damping_ns_per_m: NonNegative = 0.0
    """Damping of the virtual coupling."""
    friction_ns_per_m: NonNegative = 0.0
    """Viscous damping of the moving part itself."""
    handle_mass_kg: Positive | None = None
    """Moving mass of a force-commanded handle, for the observer of the force of the hand."""
    drive_rate_hz: Annotated[FiniteFloat, Field(ge=50, le=1e6)] | None = None
    """Rate with which a drive that closes the coupling itself computes its force. Default: that of
    the class of the drive."""
    moving_mass_kg: Positive | None = None
    """Moving mass. If it is given in place of the stiffness, a drive that accepts forces follows
    its velocity in a loop for this mass."""


class DrivesSettings(Section):
    """Section `[drives]` of a rig file: the settings of the drives of slave and master.

    The drive of the master is optional. Without this drive, the handle is passive. Only the master
    side of a telemanipulator on two computers has no drive of the slave.
    """

    slave: DriveSettings | None = None
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
    rate_hz: Annotated[FiniteFloat, Field(ge=50, le=100_000)] = USUAL_RATE
    buses: Annotated[dict[str, BusSettings], Field(min_length=1)]
    channels: ChannelsSettings
    drives: DrivesSettings
    limits: LimitsSettings
    transmission: TransmissionSettings | None = None

    @property
    def has_slave(self) -> bool:
        """Whether the rig has a slave. If not, it is the master side of two computers."""
        return self.drives.slave is not None

    @property
    def has_master(self) -> bool:
        """Whether the rig has a part of a master: its drive, or a channel."""
        channels = self.channels
        return bool(self.drives.master or channels.master_force or channels.master_position)


def coupling_of(drive: DriveSettings, period: float) -> CouplingParameters | None:
    """Return the coupling of a drive that accepts forces; None if the section describes none.

    `period` is the period of the control loop [s].
    """
    if drive.max_force_n is None:
        return None
    friction, latency = drive.friction_ns_per_m, drive.latency_ticks
    if drive.moving_mass_kg is not None:
        return velocity_loop(drive.moving_mass_kg, friction, latency, period, drive.max_force_n)
    if drive.stiffness_n_per_m is None:
        return None
    return CouplingParameters(
        drive.stiffness_n_per_m,
        drive.damping_ns_per_m,
        max_force=drive.max_force_n,
        latency=latency,
        friction=friction,
    )
