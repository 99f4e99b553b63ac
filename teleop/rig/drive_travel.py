"""Compare the commanded travel of a drive with the measured travel."""

from __future__ import annotations

import math

from drivers import Measurement
from drivers.rig_sections import ChannelsSettings

BAND = 0.25
"""Allowed difference between measured and commanded travel, as a fraction of the commanded
travel."""
SLACK = 50e-6
"""Additional allowed difference, for backlash and for the lag of a small motion [m]."""


class DriveTravel:
    """Commanded and measured travel of a drive since the beginning of a stroke.

    Parameters
    ----------
    name
        Name of the drive, `master` or `slave`.
    channels
        Section of the rig file that describes the channels.
    compliance
        Compliance of the slave's drive under the contact force [m/N].
    """

    def __init__(self, name: str, channels: ChannelsSettings, compliance: float) -> None:
        encoder = channels.master_position if name == "master" else channels.slave_position
        self.commanded = 0.0
        """Commanded travel since the beginning of the stroke [m]."""
        self._name = name
        self._compliance = compliance if name == "slave" else 0.0
        self._resolution = encoder.resolution_um * 1e-6 if encoder else 0.0
        self._position = self._force = self._start = self._start_force = math.nan
        self._integral = 0.0

    def begin(self) -> None:
        """Begin a stroke: set the commanded and the measured travel to zero."""
        self.commanded = self._integral = 0.0
        self._start, self._start_force = self._position, self._force

    def advance(self, velocity: float, measurement: Measurement, dt: float) -> None:
        """Update the travel with one tick.

        Parameters
        ----------
        velocity
            Commanded velocity since the previous tick [m/s].
        measurement
            Measurement of this tick.
        dt
            Time since the previous tick [s].
        """
        self.commanded += velocity * dt
        slave = self._name == "slave"
        self._position = measurement.slave_position if slave else measurement.master_position
        self._integral += (measurement.slave_velocity if slave else math.nan) * dt
        self._force = measurement.contact_force

    @property
    def moved(self) -> float:
        """Travel that the encoder measured since the beginning of the stroke [m].

        NaN if the drive has no encoder.
        """
        return self._position - self._start

    @property
    def explained(self) -> float:
        """Largest travel error that encoder resolution and drive compliance can cause [m]."""
        return self._resolution + self._compliance * abs(self._force - self._start_force)

    def problem(self, settled: bool) -> str:
        """Return a text that describes the problem of the measured travel; empty for no problem.

        Parameters
        ----------
        settled
            Whether the drive had enough time to complete the commanded travel. If not, a measured
            travel that is too small is not a problem. A travel that is too large or in the
            opposite direction is always a problem.
        """
        slack = SLACK + self.explained
        band = BAND * abs(self.commanded) + slack
        shown = {f"{self._name}_position": self.moved}
        if settled:
            shown[f"{self._name}_velocity"] = self._integral
        for channel, moved in shown.items():
            along = math.copysign(1.0, self.commanded) * moved
            behind = abs(self.commanded) - along
            if behind < -band or (behind > band if settled else along < -slack):
                part = "sign" if along < 0.0 else "scale"
                return (
                    f"commanded {self.commanded * 1e3:+.3f} mm, {channel} shows "
                    f"{moved * 1e3:+.3f} mm: expected a difference of at most {BAND:.0%} and "
                    f"{slack * 1e3:.2f} mm: check the {part} of drives.{self._name} and of "
                    f"channels.{channel}"
                )
        return ""
