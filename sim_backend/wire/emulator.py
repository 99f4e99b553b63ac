"""Emulator of all devices in a rig file. It creates the serial ports and CAN buses for a host."""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from drivers.rig_file import RigFile
from drivers.rig_sections import CanSettings
from sim_backend.wire.can_wires import InterfaceWire, SlcanWire
from sim_backend.wire.emulated_device import EmulatedCanDevice, EmulatedDevice, EmulatedSerialDevice
from sim_backend.wire.mechanism import Mechanism, RigMaker
from sim_backend.wire.registry import emulated_class
from sim_backend.wire.serial_wire import SerialWire
from sim_backend.wire.wire import Wire
from sim_backend.wire.wire_faults import FAULTS


class PlannedFault(NamedTuple):
    """A fault that occurs at a given time."""

    kind: str
    """One of `FAULTS` or `ACTIONS`."""
    where: str
    """Name of the bus with the fault. For the kind `reset`, name of the device."""
    at: float
    """Time after a drive was first enabled [s]."""


LATEST = 0.1
"""Largest delay that the emulator makes up for [s]. Steps overdue for longer are omitted."""
ACTIONS = ("unplug", "replug", "reset")
"""Further kinds of faults: a bus is disconnected or connected again, or a device restarts."""


class Emulator:
    """Emulated devices of a rig file, with one wire per bus in the file.

    The emulator is a context manager, which opens and closes the wires. Serial ports and slcan
    adapters are pseudo-terminals. For a CAN bus with another interface, python-can connects the
    emulator to the bus.

    Parameters
    ----------
    file
        The rig file.
    make_rig
        Function that returns a new simulated telemanipulator.
    folder
        Folder of the pseudo-terminals. Each pseudo-terminal has the name of its bus.
    faults
        Planned faults.
    now
        Function that returns the time of the clock [s].

    Raises
    ------
    ValueError
        The rig file has a device of a kind without emulation.
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
        """Return the name and the emulated device of each device that is on a bus."""
        found = []
        for name, settings in self.file.devices.items():
            if not hasattr(settings, "bus"):
                continue
            try:
                kind = emulated_class(settings.kind)
            except KeyError:
                raise ValueError(
                    f"devices.{name}: there is no emulated {settings.kind}: expected a package "
                    "that provides one"
                ) from None
            found.append((name, kind(name, settings, self.mechanism.mounts[name])))
        return found

    def _on(self, bus: str) -> list[EmulatedDevice]:
        return [d for d in self.devices.values() if d.settings.bus == bus]

    def _wire(self, bus: str, folder: Path) -> Wire:
        settings = self.file.sections.buses[bus]
        path = folder / bus
        if not isinstance(settings, CanSettings):
            (device,) = self._on(bus)
            assert isinstance(device, EmulatedSerialDevice)
            return SerialWire(path, device, settings.baud_bps)
        devices = [d for d in self._on(bus) if isinstance(d, EmulatedCanDevice)]
        if settings.interface == "slcan":
            return SlcanWire(path, devices)
        return InterfaceWire(settings.interface, settings.channel, devices)

    def reset(self, name: str) -> None:
        """Restart a device, as after a loss of power."""
        old = self.devices[name]
        new = type(old)(name, old.settings, old.mount)
        self.devices[name] = new
        for wire in self.wires.values():
            wire.exchange(old, new)

    def inject(self, fault: PlannedFault) -> None:
        """Apply a planned fault now, independently of its planned time."""
        if fault.kind == "reset":
            self.reset(fault.where)
        elif fault.kind == "unplug":
            self.wires[fault.where].close()
        elif fault.kind == "replug":
            self.wires[fault.where].open()
        else:
            self.wires[fault.where].fault = FAULTS[fault.kind]()

    def step(self, wires: Iterable[Wire] | None = None) -> None:
        """Advance the telemanipulator and the devices to the present time.

        Parameters
        ----------
        wires
            Wires whose devices are advanced; None for all.
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
        """Serve all wires until `stopped()` is True.

        A wire is served when a frame of its devices is due, or when the host has sent data. All
        wires are also served at the rate of the rig, so that watchdogs can expire.

        Parameters
        ----------
        stopped
            Function that returns whether to end.
        each_period
            Function that is called in each period of the rig. It must not block.
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


def host_ports(file: RigFile, folder: Path) -> dict[str, str]:
    """Return the serial port or CAN channel that a host must open for each bus, by name of the bus.

    `folder` is the folder of the pseudo-terminals.
    """
    return {
        name: bus.channel
        if isinstance(bus, CanSettings) and bus.interface != "slcan"
        else str(folder / name)
        for name, bus in file.sections.buses.items()
    }


def host_file(file: RigFile, folder: Path) -> str:
    """Return the text of the rig file for a host, with the ports of the emulator.

    Paths of files in this text are absolute. `folder` is the folder of the pseudo-terminals.
    """
    import tomlkit

    document = tomlkit.parse(file.text)
    for name, port in host_ports(file, folder).items():
        bus = document["buses"][name]
        bus["port" if bus["kind"] == "serial" else "channel"] = port
    for name, device in file.devices.items():
        for key, value in device:
            if isinstance(value, Path):
                document["devices"][name][key] = str(value.resolve())
    return tomlkit.dumps(document)
