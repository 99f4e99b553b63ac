"""Compare the commanded travel (distance moved) of a drive with the measured travel."""

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
    """Commanded and measured travel (distance moved) of a drive during a stroke.

    A stroke is a small motion in one direction. It is a part of the check of the drives.
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
        """Begin a stroke (a motion in one direction): set commanded and measured travel to zero."""
        self.commanded = self._integral = 0.0
        self._start, self._start_force = self._position, self._force

    def advance(self, velocity: float, measurement: Measurement, dt: float) -> None:
        """Update the commanded and the measured travel with the data of one tick."""
        self.commanded += velocity * dt
        slave = self._name == "slave"
        self._position = measurement.slave_position if slave else measurement.master_position
        self._integral += (measurement.slave_velocity if slave else math.nan) * dt
        self._force = measurement.contact_force

    @property
    def moved(self) -> float:
        """Travel since the beginning of the stroke, measured by the encoder [m].

        A stroke is a motion in one direction. The value is NaN if the drive has no encoder.
        """
        return self._position - self._start

    @property
    def explained(self) -> float:
        """Difference of commanded and measured travel that two known effects can cause [m].

        The effects are the resolution of the encoder, and the displacement of the drive by a change
        of the contact force (compliance times change of force).
        """
        return self._resolution + self._compliance * abs(self._force - self._start_force)

    def problem(self, settled: bool) -> str:
        """Return a text that describes an error of the measured travel; empty if there is no error.

        The measured travel is compared with the commanded travel. A travel that is too large or in
        the opposite direction is always an error.
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
