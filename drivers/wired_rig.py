"""A rig with real devices on ports, CAN buses and networks. A rig file describes the rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import NamedTuple

from drivers.axes import Axis, CoupledAxis, make_axis
from drivers.device import (
    DerivedDevice,
    Device,
    Drive,
    LibraryDevice,
    Sample,
    SharedSerialDevice,
    sole_drive,
)
from drivers.rig import (
    AXES,
    CHANNELS,
    LONGEST_STOP,
    STANDSTILL,
    Ages,
    Command,
    Measurement,
    NotStoppedError,
    Rig,
    RigError,
    new_tuple,
)
from drivers.rig_file import RigFile
from drivers.rig_sections import CanSettings, DriveSettings, TcpSettings, UdpSettings
from drivers.transports.bus import Bus
from drivers.transports.can_bus import CanBus
from drivers.transports.datagram_port import DatagramPort
from drivers.transports.serial_port import SerialPort
from drivers.transports.shared_line import SharedLine
from drivers.transports.stream_port import StreamPort
from drivers.transports.tcp_port import TcpPort

FIRST_SAMPLES = 2.0
"""Longest wait until every channel has a first sample [s]."""
ENABLING = 2.0
"""Longest time from the first call of `enable` until all drives are in operation [s]."""


FASTEST = 2.0
"""Largest measured speed of a coupled axis, in multiples of its largest commanded speed."""


class Channel(NamedTuple):
    """A channel of the rig, and the signal of a device that measures it.

    The value of the channel in SI units is gain * signal + offset.
    """

    device: Device
    signal: str
    gain: float
    """Gain, positive or negative [SI unit of the channel per unit of the signal]."""
    offset: float
    """Offset, in the SI unit of the channel."""
    lag: float
    """Delay of the sensor, which is added to the age of each sample [s]."""


class WiredDrive(NamedTuple):
    """A drive of the rig as an axis, with its largest speed."""

    name: str
    """`master` or `slave`."""
    place: int
    """Index of the drive's velocity in a `Command`."""
    axis: Axis
    max_velocity: float
    """Largest speed [m/s]."""


class WiredRig(Rig):
    """A telemanipulator that consists of real devices.

    `rate` is the rate of the control loop [Hz]; default: that of the rig file.
    """

    def __init__(self, file: RigFile, now: Callable[[], float], rate: float | None = None) -> None:
        self.file = file
        self._period = 1.0 / (rate or file.sections.rate_hz)
        self.devices = file.make_devices()
        self.buses = {name: make_bus(name, file, now) for name in file.sections.buses}
        for name in {d.settings.bus for d in self.devices.values() if is_shared(d)}:
            stream = self.buses[name]
            assert isinstance(stream, StreamPort)
            self.buses[name] = SharedLine(stream)
        self._transmitting = [
            (bus, [device for device in self.devices.values() if self._bus_of(device) is bus])
            for bus in self.buses.values()
        ]
        self._without_bus = [d for d in self.devices.values() if not self._bus_of(d)]
        self._now = now
        self._channels = {
            name: Channel(
                self.devices[c.device],
                c.signal,
                c.gain,
                c.offset,
                c.lag_ms * 1e-3,
            )
            for name, c in file.sections.channels.items()
        }
        self._sources = [self._channels.get(name) for name in CHANNELS]
        self._drives = [
            WiredDrive(name, AXES.index(name), self._axis(name, d), d.max_velocity_mm_per_s * 1e-3)
            for name, d in file.sections.drives.items()
        ]
        # Axes that need the measured position of their moving part, with its channel.
        self._coupled = [
            (drive.name, drive.axis, CHANNELS.index(f"{drive.name}_position"))
            for drive in self._drives
            if isinstance(drive.axis, CoupledAxis)
        ]
        self._hand = self._axis_at_the_hand()
        self._enabling = self._stopping = math.nan
        self._enabled = False
        self._operating = False
        """Whether a drive can be in operation: from `enable` until `idle` returns True."""

    def _axis(self, name: str, settings: DriveSettings) -> Axis:
        """Return the axis of a drive in the rig file."""
        device = self.devices[settings.device]
        drive = device.drives[sole_drive(device, settings.drive)]
        sections = self.file.sections
        limits = sections.limits
        position = sections.channels.position_of(name)

        def reading() -> float:
            return device.samples[drive.signal].value

        return make_axis(
            drive,
            settings.sign,
            reading,
            self.file.coupling(name, self._period),
            limits.rest_velocity_mm_per_s * 1e-3,
            FASTEST * settings.max_velocity_mm_per_s * 1e-3,
            position.max_age_ms * 1e-3 if position else 0.0,
        )

    def _axis_at_the_hand(self) -> CoupledAxis | None:
        """Return the axis whose coupling gives the force of the hand; None if it is measured."""
        if "master_force" in self._channels:
            return None
        for _, axis, index in self._coupled:
            if CHANNELS[index] == "master_position":
                return axis
        return None

    @property
    def drives(self) -> Mapping[str, Drive]:
        """Drives of the rig by the name of their axis, `master` or `slave`."""
        return {wired.name: wired.axis.drive for wired in self._drives}

    @property
    def coupled(self) -> frozenset[str]:
        """Names of the axes whose drive accepts forces or closes a coupling."""
        return frozenset(name for name, *_ in self._coupled)

    @property
    def rejected(self) -> Mapping[str, Mapping[str, int]]:
        """Number of rejected messages of each device, for each reason of rejection.

        For example, `rejected["handle"]["checksum"]` is the number of messages of the device
        `handle` with a wrong checksum. Devices without rejected messages are omitted.
        """
        return {name: device.rejected for name, device in self.devices.items() if device.rejected}

    def open(self) -> None:
        """Connect to every device, and wait for a sample of every channel."""
        for bus in self.buses.values():
            bus.open()
            bus.pump = self._poll
        for device in self.devices.values():
            if own := self._bus_of(device):
                own.connect(device)
        for device in self.devices.values():
            if own := self._bus_of(device):
                own.start(device)
            elif isinstance(device, DerivedDevice):
                device.start(self.devices)
            elif isinstance(device, LibraryDevice):
                device.start(self._now)
        end = self._now() + FIRST_SAMPLES
        while silent := [name for name, value in self._values().items() if math.isnan(value)]:
            if self._now() > end:
                raise RigError(f"no sample of {self._sources_of(silent)} in {FIRST_SAMPLES:g} s")
            next(iter(self.buses.values())).wait_for(lambda: False, 1e-3)

    def _values(self) -> dict[str, float]:
        return {name: c.device.samples[c.signal].value for name, c in self._channels.items()}

    def _sources_of(self, channels: list[str]) -> str:
        """Return a text for an error message about channels that have no sample.

        For each channel, the text gives the device, its bus, the number of its rejected messages
        and the error that it reports.
        """
        parts = []
        for name in channels:
            device = self._channels[name].device
            found = [f"{n} rejected for {why}" for why, n in device.rejected.items()]
            if device.error:
                found.append(device.error)
            bus = getattr(device.settings, "bus", "")
            instead = f": {', '.join(found)}" if found else ""
            parts.append(f"{name} ({device.name} on {bus}{instead})")
        return ", ".join(parts)

    def _bus_of(self, device: Device) -> Bus | None:
        """Return the bus of a device; None if it is connected to none."""
        name = getattr(device.settings, "bus", None)
        return None if name is None else self.buses[name]

    def _poll(self) -> None:
        """Read every bus, and then call the method `update` of every device.

        If a bus cannot be read, the other buses are still read, because they can have the messages
        with which drives confirm a stop. Then the error is raised.
        """
        error = None
        for bus in self.buses.values():
            try:
                bus.poll()
            except RigError as failed:
                error = error or failed
        now = self._now()
        for device in self.devices.values():
            device.update(now)
        if error:
            raise error

    def read(self) -> Measurement:
        """Read every bus, and return the latest sample of every channel."""
        self._poll()
        now = self._now()
        values, ages = [], []
        for channel in self._sources:
            if channel is None:
                values.append(math.nan)
                ages.append(0.0)
            else:
                device, signal, gain, offset, lag = channel
                value, time = device.samples[signal]
                values.append(gain * value + offset)
                ages.append(now - time + lag)
        error, stop = "", False
        for name, axis, index in self._coupled:
            source = self._sources[index]
            assert source
            time = source.device.samples[source.signal].time
            axis.measure(Sample(values[index], time))
            if axis.error:
                error = error or f"drive {name}: {axis.error}"
        if self._hand:
            values[0], ages[0] = self._hand.force, ages[CHANNELS.index("master_position")]
        for device in self.devices.values():
            if device.error:
                error = error or f"{device.name}: {device.error}"
            stop = stop or device.emergency_stop
        return new_tuple(Measurement, (now, *values, new_tuple(Ages, ages), error, stop))

    def rearm(self) -> None:
        """Clear the latched errors of all devices (errors that are reported until cleared)."""
        for device in self.devices.values():
            device.rearm()
        for _, axis, _ in self._coupled:
            axis.rearm()

    def enable(self) -> bool:
        """Request that all drives go into operation; return whether all drives are in operation."""
        if math.isnan(self._enabling):
            self._enabling, self._stopping = self._now(), math.nan
            self._operating = True
        ready = [drive.axis.enable() for drive in self._drives]
        self._enabled = all(ready)
        if not self._enabled and self._now() - self._enabling > ENABLING:
            late = [
                d.name + (f" (waits for {d.axis.waits_for})" if d.axis.waits_for else "")
                for d, r in zip(self._drives, ready, strict=True)
                if not r
            ]
            raise RigError(f"drive {' and '.join(late)} not ready within {ENABLING:g} s")
        return self._enabled

    def write(self, command: Command) -> Command:
        """Limit velocities to the range of each drive, and send them to the drives.

        Until all drives are in operation, zero velocity is sent instead.
        """
        if not all(map(math.isfinite, command)):
            raise ValueError(f"a velocity command must be finite, got {command}")
        if not self._enabled:
            command = STANDSTILL
        applied, now = [*STANDSTILL], self._now()
        for _, place, axis, most in self._drives:
            v = min(max(command[place], -most), most)
            applied[place] = axis.command(v, now)
        for bus, devices in self._transmitting:
            bus.transmit(devices)
        for device in self._without_bus:
            device.transmit()
        return new_tuple(Command, applied)

    def idle(self) -> bool:
        """Take every drive out of operation; return whether every drive has confirmed it.

        If this fails for one drive, the other drives are still taken out of operation. Then the
        error is raised.
        """
        self._enabled, self._enabling = False, math.nan
        if math.isnan(self._stopping):
            self._stopping = self._now()
        running = {wired.name: wired.axis for wired in self._drives}
        with ExitStack() as stack:
            for name in list(running):
                stack.callback(self._stop, name, running)
        if not running:
            self._operating, self._stopping = False, math.nan
            return True
        if self._now() - self._stopping > LONGEST_STOP:
            raise NotStoppedError(
                f"drive {' and '.join(running)}: no confirmation within {LONGEST_STOP:g} s that it "
                "is out of operation: if it moves, use the hardware emergency stop"
            )
        return False

    @staticmethod
    def _stop(name: str, running: dict[str, Axis]) -> None:
        """Take a drive out of operation. If it has confirmed this, remove it from `running`."""
        if running[name].idle():
            del running[name]

    def close(self) -> None:
        """End the communication with every device, and close every bus.

        If a drive was in operation and has not confirmed that it has left operation, the request
        is first repeated for up to 0.5 s.
        """
        with ExitStack() as stack:
            for bus in self.buses.values():
                stack.callback(bus.close)
            for device in self.devices.values():
                stack.callback(device.stop)
            if self._operating:
                next(iter(self.buses.values())).wait_for(self.idle, 2.0 * LONGEST_STOP)


def is_shared(device: Device) -> bool:
    """Return whether a device may share its serial line with other devices."""
    return isinstance(device, SharedSerialDevice)


def make_bus(name: str, file: RigFile, now: Callable[[], float]) -> Bus:
    """Return the bus with this name in a rig file. The bus is not yet open."""
    settings = file.sections.buses[name]
    if isinstance(settings, TcpSettings):
        return TcpPort(name, now, settings.host, settings.port, settings.baud_bps)
    if isinstance(settings, UdpSettings):
        return DatagramPort(
            name,
            now,
            settings.host,
            settings.port,
            settings.local_host,
            settings.local_port or 0,
        )
    if isinstance(settings, CanSettings):
        return CanBus(
            name,
            now,
            settings.interface,
            settings.channel,
            settings.bitrate_bps,
            settings.options,
            settings.fd,
            settings.data_bitrate_bps,
        )
    return SerialPort(name, now, settings.port, settings.baud_bps)
