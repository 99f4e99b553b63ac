"""A rig to which the sending of commands can be paused, to test the watchdogs of the drives."""

from __future__ import annotations

from collections.abc import Iterator

from drivers import STANDSTILL, Command, Measurement, Rig
from drivers.wired_rig import WiredRig


class PausableRig(Rig):
    """An open rig. While `paused` is True, no command is sent, and the watchdogs stop the drives.

    Parameters
    ----------
    rig
        The rig, which has been opened.
    """

    def __init__(self, rig: WiredRig) -> None:
        self.paused = False
        """Whether the commands are paused. If True, no commands are sent, and the measurement does
        not contain the errors of the drives."""
        self.applied = STANDSTILL
        """Latest command that the drives have applied."""
        drives = dict(rig.file.sections.drives.items())
        self._rig = rig
        self._drives = {name: rig.devices[drive.device] for name, drive in drives.items()}
        moving = list(self._drives.values())
        self._others = [device for device in rig.devices.values() if device not in moving]

    def open(self) -> None:
        """Do nothing, because the rig is already open."""

    def close(self) -> None:
        """Do nothing: the caller that opened the rig closes it."""

    def read(self) -> Measurement:
        """Return the measurement of the rig.

        While the commands are paused, errors of the drives are removed from the measurement.
        """
        measurement = self._rig.read()
        if not self.paused:
            return measurement
        errors = (f"{device.name}: {device.error}" for device in self._others if device.error)
        return measurement._replace(drive_error=next(errors, ""))

    def stopped(self) -> Iterator[str]:
        """Yield the name of each drive whose device reports an error."""
        return (name for name, device in self._drives.items() if device.error)

    def enable(self) -> bool:
        """Enable the drives; return whether all drives are in operation."""
        return self._rig.enable()

    def rearm(self) -> None:
        """Clear the errors of the drives."""
        self._rig.rearm()

    def write(self, command: Command) -> Command:
        """Send a command to the drives, and return the command that the drives apply.

        While the commands are paused, nothing is sent, and the result is zero velocity.
        """
        self.applied = STANDSTILL if self.paused else self._rig.write(command)
        return self.applied

    def idle(self) -> None:
        """Disable the drives."""
        self._rig.idle()
