"""A rig whose commands can be paused."""

from __future__ import annotations

from collections.abc import Iterator

from drivers import STANDSTILL, Command, Measurement, Rig
from drivers.wired_rig import WiredRig


class PausableRig(Rig):
    """An opened rig whose commands can be paused, so that the drives' watchdogs act.

    Parameters
    ----------
    rig
        The rig, opened.
    """

    def __init__(self, rig: WiredRig) -> None:
        self.paused = False
        """Whether no commands are sent, and errors of the drives are not reported."""
        self.applied = STANDSTILL
        """Command that the drives applied last."""
        drives = dict(rig.file.sections.drives.items())
        self._rig = rig
        self._drives = {name: rig.devices[drive.device] for name, drive in drives.items()}
        moving = list(self._drives.values())
        self._others = [device for device in rig.devices.values() if device not in moving]

    def open(self) -> None:
        """Do nothing, because the rig is open."""

    def close(self) -> None:
        """Do nothing: the caller that opened the rig closes it."""

    def read(self) -> Measurement:
        """Return the measurement of the rig; while paused, without errors of the drives."""
        measurement = self._rig.read()
        if not self.paused:
            return measurement
        errors = (f"{device.name}: {device.error}" for device in self._others if device.error)
        return measurement._replace(drive_error=next(errors, ""))

    def stopped(self) -> Iterator[str]:
        """Return the names of the drives that report an error."""
        return (name for name, device in self._drives.items() if device.error)

    def enable(self) -> bool:
        """Enable the drives; return whether they are ready for commands."""
        return self._rig.enable()

    def rearm(self) -> None:
        """Clear the errors of the drives."""
        self._rig.rearm()

    def write(self, command: Command) -> Command:
        """Command the drives unless paused; return the applied command."""
        self.applied = STANDSTILL if self.paused else self._rig.write(command)
        return self.applied

    def idle(self) -> None:
        """Disable the drives."""
        self._rig.idle()
