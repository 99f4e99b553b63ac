"""One side of a simulated telemanipulator, as a station of two computers has it."""

from __future__ import annotations

import math
from typing import Literal

from drivers import Command, Measurement
from sim_backend.simulated_rig import SimulatedRig


class OneSidedRig(SimulatedRig):
    """Simulated rig of which only the master or only the slave is measured and moved.

    `side` is set after the creation: `master` or `slave`.
    """

    side: Literal["master", "slave"] = "slave"

    def read(self) -> Measurement:
        """Return the measured values; NaN for the channels of the other side."""
        measured, nan = super().read(), math.nan
        if self.side == "master":
            return measured._replace(slave_position=nan, contact_force=nan, slave_velocity=nan)
        return measured._replace(master_force=nan, master_position=nan)

    def write(self, command: Command) -> Command:
        """Command the velocity of the drive of this side."""
        master, slave = command
        own = Command(master, 0.0) if self.side == "master" else Command(0.0, slave)
        return super().write(own)
