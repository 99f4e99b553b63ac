"""Drives of a simulated slave that accept forces or positions in place of velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from drivers.axes import Axis, CoupledAxis, PositionAxis
from drivers.coupling import CouplingParameters, VirtualCoupling, is_stable, velocity_loop
from drivers.device import PositionDrive
from sim_backend.force_master import LONGEST_STEP, SimulatedMotor
from sim_backend.plant import PlantParameters, Slave

SlaveDriveName = Literal["velocity", "position"]
SERVO_GAIN = 100.0
"""Gain of the position servo of a simulated drive [1/s]."""


@dataclass(frozen=True)
class ForceSlave:
    """A slave whose drive accepts forces. The host closes its velocity loop.

    Raises
    ------
    ValueError
        A value is out of range.
    """

    mass: float = PlantParameters.slave_mass
    """Moving mass for which the velocity loop is tuned [kg]."""
    latency: int = 1
    """Whole periods from a measurement to the force that is computed from it."""
    max_force: float = 500.0
    """Greatest force of the motor [N]."""

    def __post_init__(self) -> None:
        for name in ("mass", "max_force"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} of the slave must be positive, got {getattr(self, name)}")
        if not 0 <= self.latency <= 20:
            raise ValueError(f"latency of the slave must be 0 to 20 periods, got {self.latency}")

    def loop(self, period: float) -> CouplingParameters:
        """Return the velocity loop for the period of the control loop [s]."""
        return velocity_loop(self.mass, 0.0, self.latency, period, self.max_force)

    def problem(self, mass: float, period: float) -> str:
        """Return why the velocity loop is not stable with the true moving mass; empty if it is."""
        if is_stable(self.loop(period), period, mass):
            return ""
        return (
            f"mass {self.mass:g} kg: the velocity loop that is tuned for this mass is unstable "
            f"with the moving mass of {mass:g} kg: expected about {mass:g} kg"
        )


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


def make_slave_axis(kind: SlaveDriveName | ForceSlave, slave: Slave, period: float) -> Axis | None:
    """Return the axis of a slave with such a drive; None for a drive that accepts velocities."""
    if kind == "position":
        return PositionAxis(SlaveServo(slave), 1, lambda: slave.x, LONGEST_STEP)
    if isinstance(kind, ForceSlave):
        coupling = VirtualCoupling(kind.loop(period), LONGEST_STEP)
        return CoupledAxis(SimulatedMotor(slave, kind.latency, None), 1, coupling, 0.05, 1.0)
    return None
