"""Emulator of all devices in a rig file (TOML file that describes a telemanipulator).

It creates serial ports, CAN buses and network ports. A host (the program that controls the devices)
can open them like those of real devices.
"""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from drivers.device import LibraryDevice
from drivers.registry import device_class
from drivers.rig_file import RigFile
from drivers.rig_sections import CanSettings, TcpSettings, UdpSettings
from sim_backend.wire.can_wires import InterfaceWire, SlcanWire
from sim_backend.wire.emulated_device import (
    EmulatedCanDevice,
    EmulatedDatagramDevice,
    EmulatedDevice,
    EmulatedSerialDevice,
)
from sim_backend.wire.mechanism import Mechanism, RigMaker
from sim_backend.wire.network_wires import TcpWire, UdpWire
from sim_backend.wire.registry import emulated_class
from sim_backend.wire.serial_wire import SerialWire
from sim_backend.wire.wire import Wire
from sim_backend.wire.wire_faults import FAULTS


class PlannedFault(NamedTuple):
    """A fault of a device or of its communication, which the emulator applies at a given time."""

    kind: str
    """Kind of the fault: one of the names in `FAULTS` or `ACTIONS`."""
    where: str
    """Name of the bus to which the fault is applied. For the kind `reset`, name of the device."""
    at: float
    """Planned time of the fault [s], counted from the time at which a drive is first enabled."""


LATEST = 0.1
"""Largest delay of a periodic step of the emulator [s]. Steps with a larger delay are omitted."""
ACTIONS = ("unplug", "replug", "reset")
"""Kinds of faults that are not in `FAULTS`: disconnect or reconnect a bus, restart a device."""


class Emulator:
    """Emulated devices of a rig file (TOML file that describes a telemanipulator).

    For each bus in the rig file, the emulator has a `Wire`, which connects the devices on the bus
    to the host. The emulator is a context manager. It opens the wires at the start and closes them
    at the end. Serial ports, and the serial ports of slcan adapters, are pseudo-terminals. Other
    CAN buses are opened with python-can. UDP and TCP use free ports of the loopback interface.
    """

    def __init__(
        self,
        file: RigFile,
        make_rig: RigMaker,
        folder: Path,
        faults: Sequence[PlannedFault] = (),
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.file = file
        self._faults = sorted(faults, key=lambda fault: fault.at)
        self._started = math.inf
        self._now = now
        self.mechanism = Mechanism(file, make_rig, now)
        self.devices = dict(self._emulated())
        self.wires = {name: self._wire(name, folder) for name in file.sections.buses}

    def _emulated(self) -> list[tuple[str, EmulatedDevice]]:
        """Return name and emulated device for each device of the rig file that is on a bus."""
        found = []
        for name, settings in self.file.devices.items():
            if not hasattr(settings, "bus"):
                if issubclass(device_class(settings.kind), LibraryDevice):
                    raise ValueError(
                        f"devices.{name}: {settings.kind}: a library of the vendor accesses it: "
                        "expected devices with a bus, which can be emulated"
                    )
                continue
            try:
                kind = emulated_class(settings.kind)
            except KeyError:
                raise ValueError(
                    f"devices.{name}: there is no emulated {settings.kind}: expected a package "
                    "that provides one"
                ) from None
            except ImportError as error:
                raise ValueError(f"devices.{name}: {settings.kind}: {error}") from error
            found.append((name, kind(name, settings, self.mechanism.mounts[name])))
        return found

    def _on(self, bus: str) -> list[EmulatedDevice]:
        return [d for d in self.devices.values() if d.settings.bus == bus]

    def _wire(self, bus: str, folder: Path) -> Wire:
        settings = self.file.sections.buses[bus]
        path = folder / bus
        if isinstance(settings, UdpSettings):
            device = next(iter(self._on(bus)), None)
            if not isinstance(device, EmulatedDatagramDevice):
                raise ValueError(f"buses.{bus}: no device uses it")
            return UdpWire(device)
        if not isinstance(settings, CanSettings):
            lined = [d for d in self._on(bus) if isinstance(d, EmulatedSerialDevice)]
            if isinstance(settings, TcpSettings):
                return TcpWire(lined, settings.baud_bps)
            return SerialWire(path, lined, settings.baud_bps)
        devices = [d for d in self._on(bus) if isinstance(d, EmulatedCanDevice)]
        if settings.interface == "slcan":
            return SlcanWire(path, devices)
        return InterfaceWire(settings.interface, settings.channel, settings.fd, devices)

    def reset(self, name: str) -> None:
        """Restart the device with this name, as after an interruption of its power supply."""
        old = self.devices[name]
        new = type(old)(name, old.settings, old.mount)
        self.devices[name] = new
        for wire in self.wires.values():
            wire.exchange(old, new)

    def inject(self, fault: PlannedFault) -> None:
        """Apply a fault now. The planned time of the fault is ignored."""
        if fault.kind == "reset":
            self.reset(fault.where)
        elif fault.kind == "unplug":
            self.wires[fault.where].close()
        elif fault.kind == "replug":
            self.wires[fault.where].open()
        else:
            self.wires[fault.where].distort(FAULTS[fault.kind])

    def step(self, wires: Iterable[Wire] | None = None) -> None:
        """Advance the simulated telemanipulator and the emulated devices to the present time.

        `wires`: None for all wires of the emulator.

        Planned faults whose time is reached are applied before the devices are advanced.
        """
        self.mechanism.advance()
        now = self._now()
        if self.mechanism.driven:
            self._started = min(self._started, now)
        while self._faults and now - self._started >= self._faults[0].at:
            self.inject(self._faults.pop(0))
        for wire in self.wires.values() if wires is None else wires:
            wire.serve(now)

    def serve(
        self, stopped: Callable[[], bool], each_period: Callable[[], None] = lambda: None
    ) -> None:
        """Pass data between the emulated devices and the host until `stopped()` is True.

        The data of a wire (serial line or CAN bus) are passed when one of its devices must send a
        frame, or when the host has sent data. The data of all wires are also passed periodically,
        at the sample rate in the rig file, so that watchdogs of the devices can expire.
        """
        period = 1.0 / self.file.sections.rate_hz
        wires = list(self.wires.values())
        round_due = self._now()
        while not stopped():
            files = {number: wire for wire in wires for number in wire.filenos()}
            wake = min(round_due, *(wire.due() for wire in wires))
            readable, _, _ = select.select(files, (), (), max(wake - self._now(), 0.0))
            now = self._now()
            if now >= round_due:
                round_due = max(round_due + period, now - LATEST)
                self.step()
                each_period()
            else:
                received = {files[number] for number in readable}
                self.step([wire for wire in wires if wire in received or wire.due() <= now])

    def __enter__(self) -> Self:
        try:
            for wire in self.wires.values():
                wire.open()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for wire in self.wires.values():
            wire.close()


def host_ports(emulator: Emulator) -> dict[str, str]:
    """Return the ports and CAN channels that a host must open to connect to the emulator."""
    return {
        name: ":".join(map(str, wire.host_entries().values()))
        for name, wire in emulator.wires.items()
    }


def host_file(emulator: Emulator) -> str:
    """Return the text of a rig file with which a host connects to the emulated devices.

    The text is that of the emulator's rig file, with two changes. The ports and CAN channels are
    those of the emulator (see `host_ports`, and `http_port` of a device with a web server), and the
    paths of files are absolute.
    """
    import tomlkit

    document = tomlkit.parse(emulator.file.text)
    for name, wire in emulator.wires.items():
        document["buses"][name].update(wire.host_entries())
        for device_name, entries in wire.device_entries().items():
            document["devices"][device_name].update(entries)
    for name, device in emulator.file.devices.items():
        for key, value in device:
            if isinstance(value, Path):
                document["devices"][name][key] = str(value.resolve())
    return tomlkit.dumps(document)
