"""Drives of a simulated slave that accept forces or positions in place of velocities."""

from __future__ import annotations

from typing import Literal

from drivers.axes import Axis, CoupledAxis, PositionAxis
from drivers.coupling import VirtualCoupling, velocity_loop
from drivers.device import PositionDrive
from sim_backend.force_master import LONGEST_STEP, SimulatedMotor
from sim_backend.plant import PlantParameters, Slave

SlaveDriveName = Literal["velocity", "force", "position"]
SERVO_GAIN = 100.0
"""Gain of the position servo of a simulated drive [1/s]."""
MAX_FORCE = 500.0
"""Greatest force of a simulated slave that accepts forces [N]."""
LATENCY = 1
"""Whole periods from a measurement to the force that is computed from it."""


class SlaveServo(PositionDrive):
    """Drive of the slave with a position servo, which commands the velocity servo."""

    def __init__(self, slave: Slave) -> None:
        self._slave = slave
        self._position = 0.0
        self._operates = False

    def enable(self) -> bool:
        """Return True: the drive is in operation without delay."""
        self._operates = True
        return True

    def command(self, position: float) -> float:
        """Send a position."""
        self._position = position
        return position

    @property
    def velocity(self) -> float:
        """Command of the velocity servo [m/s]."""
        return SERVO_GAIN * (self._position - self._slave.x) if self._operates else 0.0

    def idle(self) -> bool:
        """Take the drive out of operation. It stops."""
        self._operates = False
        return True


def make_slave_axis(
    kind: SlaveDriveName, slave: Slave, parameters: PlantParameters, period: float
) -> Axis | None:
    """Return the axis of a slave with such a drive; None for a drive that accepts velocities."""
    if kind == "position":
        return PositionAxis(SlaveServo(slave), 1, lambda: slave.x, LONGEST_STEP)
    if kind == "force":
        loop = velocity_loop(parameters.slave_mass, 0.0, LATENCY, period, MAX_FORCE)
        coupling = VirtualCoupling(loop, LONGEST_STEP)
        return CoupledAxis(SimulatedMotor(slave, LATENCY, None), 1, coupling, 0.05, 1.0)
    return None
