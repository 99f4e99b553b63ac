"""The travel of a drive: as it was commanded, and as its sensors show it."""

from __future__ import annotations

import math

from drivers import Measurement
from drivers.rig_sections import ChannelsSettings

BAND = 0.25
"""Share of the commanded travel by which a sensor may differ from it."""
SLACK = 50e-6
"""Travel by which it may differ besides: backlash, and the lag of a small motion [m]."""


class DriveTravel:
    """The travel of a drive since a stroke began.

    Parameters
    ----------
    name
        Of the drive: `master` or `slave`.
    channels
        The channels of the rig.
    compliance
        How far the slave's drive yields to the contact force [m/N].
    """

    def __init__(self, name: str, channels: ChannelsSettings, compliance: float) -> None:
        encoder = channels.master_position if name == "master" else channels.slave_position
        self.commanded = 0.0
        """[m]"""
        self._name = name
        self._compliance = compliance if name == "slave" else 0.0
        self._slack = SLACK + (encoder.resolution_um * 1e-6 if encoder else 0.0)
        self._position = self._force = self._start = self._start_force = math.nan
        self._integral = 0.0

    def begin(self) -> None:
        """Start a stroke here."""
        self.commanded = self._integral = 0.0
        self._start, self._start_force = self._position, self._force

    def advance(self, velocity: float, measurement: Measurement, dt: float) -> None:
        """Add a tick.

        Parameters
        ----------
        velocity
            What the drive was commanded since the last tick [m/s].
        measurement
            What the rig reads now.
        dt
            Time since the last tick [s].
        """
        self.commanded += velocity * dt
        slave = self._name == "slave"
        self._position = measurement.slave_position if slave else measurement.master_position
        self._integral += (measurement.slave_velocity if slave else math.nan) * dt
        self._force = measurement.contact_force

    @property
    def moved(self) -> float:
        """The travel that the encoder shows [m]; NaN without an encoder."""
        return self._position - self._start

    def problem(self, settled: bool) -> str:
        """What is wrong with the travel so far; empty for nothing.

        Parameters
        ----------
        settled
            Whether the drive had time to reach its position. Before, it may be behind its
            command, but neither ahead of it nor on the wrong side.
        """
        slack = self._slack + self._compliance * abs(self._force - self._start_force)
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
                    f"{moved * 1e3:+.3f} mm: expected {BAND:.0%} and {slack * 1e3:.2f} mm at most "
                    f"between them: check the {part} of drives.{self._name} and of "
                    f"channels.{channel}"
                )
        return ""
