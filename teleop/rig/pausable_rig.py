"""A rig whose commands can be paused."""

from __future__ import annotations

from collections.abc import Iterator

from drivers import STANDSTILL, Command, Measurement, Rig
from drivers.wired_rig import WiredRig


class PausableRig(Rig):
    """An opened rig whose commands can be paused, so that its watchdogs run out."""

    def __init__(self, rig: WiredRig) -> None:
        self.paused = False
        """Whether commands, and the errors of drives that miss them, are withheld."""
        self.applied = STANDSTILL
        """What the drives made of the last command."""
        drives = dict(rig.file.sections.drives.items())
        self._rig = rig
        self._drives = {name: rig.devices[drive.device] for name, drive in drives.items()}
        moving = list(self._drives.values())
        self._others = [device for device in rig.devices.values() if device not in moving]

    def open(self) -> None:
        """Nothing: the rig is open."""

    def close(self) -> None:
        """Nothing: whoever opened the rig closes it."""

    def read(self) -> Measurement:
        """The rig's measurement; while it is paused, without errors of the drives."""
        measurement = self._rig.read()
        if not self.paused:
            return measurement
        errors = (f"{device.name}: {device.error}" for device in self._others if device.error)
        return measurement._replace(drive_error=next(errors, ""))

    def stopped(self) -> Iterator[str]:
        """Names of the drives that report an error."""
        return (name for name, device in self._drives.items() if device.error)

    def enable(self) -> bool:
        """Ask the drives to take commands."""
        return self._rig.enable()

    def rearm(self) -> None:
        """Forget the errors of drives."""
        self._rig.rearm()

    def write(self, command: Command) -> Command:
        """Command the drives, unless it is paused."""
        self.applied = STANDSTILL if self.paused else self._rig.write(command)
        return self.applied

    def idle(self) -> None:
        """Take the drives out of operation."""
        self._rig.idle()
