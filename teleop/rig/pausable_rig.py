"""A rig that can stop sending commands to its drives, to test the watchdogs of the drives.

A watchdog is a timer in a drive. It stops the drive if no commands arrive.
"""

from __future__ import annotations

from collections.abc import Iterator

from drivers import STANDSTILL, Command, Measurement, Rig
from drivers.wired_rig import WiredRig
from teleop.rig.bus_load import BusLoad


class PausableRig(Rig):
    """A rig that can stop sending commands to its drives, to test the watchdogs of the drives.

    A watchdog is a timer in a drive. It stops the drive if no commands arrive. While the attribute
    `paused` is True, no commands are sent.
    """

    def __init__(self, rig: WiredRig) -> None:
        self.paused = False
        """Whether no commands are sent to the drives. If True, the measurement also does not
        contain the errors of the drives, and the ages of samples that come only with commands."""
        self.applied = STANDSTILL
        """Latest command that the drives have applied."""
        self.load = BusLoad(rig.buses)
        """Load of the buses while commands are sent."""
        drives = dict(rig.file.sections.drives.items())
        self._rig = rig
        self._drives = {name: rig.devices[drive.device] for name, drive in drives.items()}
        self.reporting = {name for name, drive in rig.drives.items() if drive.reports_watchdog}
        """Names of the drives that report a stop by their watchdog."""
        silent = {name for name, d in rig.devices.items() if d.silent_without_commands}
        channels = rig.file.sections.channels
        self._silent = {name: 0.0 for name, c in channels.items() if c.device in silent}
        if "master_position" in self._silent and channels.master_force is None:
            self._silent["master_force"] = 0.0
        moving = list(self._drives.values())
        self._others = [device for device in rig.devices.values() if device not in moving]

    def open(self) -> None:
        """Do nothing, because the rig is already open."""

    def close(self) -> None:
        """Do nothing: the caller that opened the rig closes it."""

    def read(self) -> Measurement:
        """Return the measurement of the rig.

        While no commands are sent, the watchdogs stop the drives, and the drives report errors.
        These errors are expected, and are removed from the measurement.
        """
        measurement = self._rig.read()
        if not self.paused:
            return measurement
        errors = (f"{device.name}: {device.error}" for device in self._others if device.error)
        ages = measurement.age._replace(**self._silent)
        return measurement._replace(drive_error=next(errors, ""), age=ages)

    def stopped(self) -> Iterator[str]:
        """Yield the names of the drives that report an error, for example after a watchdog stop."""
        return (name for name in self.reporting if self._drives[name].error)

    def enable(self) -> bool:
        """Request that all drives go into operation; return whether all are in operation."""
        return self._rig.enable()

    def rearm(self) -> None:
        """Clear the latched errors of all devices (errors that are reported until cleared)."""
        self._rig.rearm()

    def write(self, command: Command) -> Command:
        """Send a command to the drives, and return the command that the drives apply.

        While the attribute `paused` is True, nothing is sent, and zero velocities are returned.
        """
        self.applied = STANDSTILL
        if not self.paused:
            self.applied = self._rig.write(command)
            self.load.update()
        return self.applied

    def idle(self) -> bool:
        """Disable the drives; return whether they have confirmed it."""
        return self._rig.idle()
