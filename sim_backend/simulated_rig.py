"""Simulated telemanipulator: its dynamics, sensors and drives, and the hand of an operator."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from drivers import CHANNELS, STANDSTILL, Ages, Command, Measurement, Rig, new_tuple
from drivers.axes import CoupledAxis
from drivers.device import Sample
from sim_backend.body import Body
from sim_backend.force_master import ForceMaster, FreeHandle, make_axis
from sim_backend.operators import ARM, Hand
from sim_backend.plant import UNATTENDED, Arm, Plant, PlantParameters
from sim_backend.sensors import Sensors
from sim_backend.slave_drives import ForceSlave, SlaveDriveName, SlaveServo, make_slave_axis

FRESH = Ages(*(0.0 for _ in CHANNELS))
MOST_MASTER_SPEED = 1.0
"""Largest speed of a force-commanded handle [m/s]. A faster handle is a drive error."""
MASTER_AT_REST = 0.02
"""Largest speed of a force-commanded handle at which it can be enabled [m/s]."""


class SimulatedRig(Rig):
    """A simulated telemanipulator (rig) with the same interface as a real one.

    Each call of `read` advances the simulation to the present time of the clock. The clock is real
    or virtual. With a virtual clock, two simulations with the same parameters and the same commands
    give exactly the same values.

    Parameters
    ----------
    body
        The specimen on which the slave presses, for example a cube.
    now
        Function that returns the time of the clock [s].
    operator
        The simulated hand that moves the handle; None if nobody holds the handle.
    parameters
        Parameters of the drives and of the dynamics of the force sensors.
    sensors
        Imperfections of the sensors.
    max_velocity
        Largest velocity of the drives [m/s].
    watchdog
        Watchdog time [s]. If the drives are enabled and receive no command for a longer time, they
        are disabled. The measurement then contains the drive error `watchdog`. The drives stay
        disabled until `enable` is called.
    seed
        Seed of the sensor noise.
    start
        Initial position of the slave [m].
    arm
        Impedance of the operator's arm. It has no effect if nobody holds the handle.
    master
        Force-commanded master; None for a master with a velocity servo. The force of the hand is
        then that of its virtual coupling.
    coupled
        Whether the rig closes this coupling. If not, `plant.handle.push` is the force of the motor,
        and the force of the hand is measured.
    slave_drive
        What the drive of the slave accepts: `velocity` or `position`, or a slave that accepts
        forces.
    period
        Period of the control loop [s], for which a drive that accepts forces is tuned.

    Raises
    ------
    ValueError
        `max_velocity` or `watchdog` is not positive or not finite.
    """

    def __init__(
        self,
        body: Body,
        now: Callable[[], float],
        operator: Hand | None = None,
        parameters: PlantParameters | None = None,
        sensors: Sensors | None = None,
        max_velocity: float = 0.5,
        watchdog: float = 0.1,
        seed: int = 0,
        start: float = 0.0,
        arm: Arm = ARM,
        master: ForceMaster | None = None,
        coupled: bool = True,
        slave_drive: SlaveDriveName | ForceSlave = "velocity",
        period: float = 1e-3,
    ) -> None:
        for name, value in (("max_velocity", max_velocity), ("watchdog", watchdog)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        attended = arm if operator else UNATTENDED
        self.plant = Plant(body, parameters or PlantParameters(), attended, master=master)
        self._axis: CoupledAxis | None = None
        if master and coupled:
            assert isinstance(self.plant.handle, FreeHandle)
            self._axis = make_axis(master, self.plant.handle, MOST_MASTER_SPEED, MASTER_AT_REST)
        self.plant.slave.move_to(start, 0.0)
        if operator:
            operator.handle = self.plant.handle
        self._slave_axis = make_slave_axis(slave_drive, self.plant.slave, period)
        self._now = now
        self._operator = operator
        self._sensors = sensors or Sensors()
        self._max_velocity = max_velocity
        self._watchdog = watchdog
        self._commanded = 0.0
        self._noise = random.Random(f"sensors {seed}")
        self._applied = STANDSTILL
        self._enabled = False
        self._error = ""
        self._start = math.inf
        self._time = 0.0

    def open(self) -> None:
        """Start the simulation at the present time of the clock. The drives remain disabled."""
        self._time = self._now()

    def read(self) -> Measurement:
        """Advance the simulation to the present time of the clock; return all measured values."""
        now = self._now()
        if now > self._time:
            intended = None
            if self._operator and now >= self._start:
                intended = self._operator.intention(now - self._start)
            silent = self._commanded + self._watchdog
            if self._enabled and now > silent:
                if silent > self._time:
                    self.plant.advance(silent - self._time, self._driven(), intended)
                    self._time = silent
                self.idle()
                self._error = "watchdog"
            self.plant.advance(now - self._time, self._driven(), intended)
            self._time = now
            if self._operator and now >= self._start:
                handle, force = self.plant.handle, self.plant.master_force
                self._operator.feel(now - self._start, handle.x, force.y)
        plant, sensors, noise = self.plant, self._sensors, self._noise
        slave = plant.slave
        position = sensors.position(plant.handle.x)
        if axis := self._axis:
            axis.measure(Sample(position, now))
            master_force = axis.force
            self._error = self._error or (axis.error and f"drive master: {axis.error}")
        else:
            master_force = sensors.force(plant.master_force.y, noise) + sensors.master_zero
        if slave_axis := self._slave_axis:
            slave_axis.measure(Sample(sensors.position(slave.x), now))
            self._error = self._error or (slave_axis.error and f"drive slave: {slave_axis.error}")
        values = (
            now,
            master_force,
            position,
            sensors.position(slave.x + sensors.contact_position),
            sensors.force(plant.contact_force.y, noise) + sensors.contact_zero,
            slave.v,
            FRESH,
            self._error,
            False,
        )
        return new_tuple(Measurement, values)

    def _driven(self) -> Command:
        """Return the velocities that the velocity servos of the plant receive."""
        if self._slave_axis and isinstance(self._slave_axis.drive, SlaveServo):
            return self._applied._replace(slave_velocity=self._slave_axis.drive.velocity)
        return self._applied

    def rearm(self) -> None:
        """Clear the drive error of an expired watchdog. The drives remain disabled."""
        self._error = ""
        for axis in (self._axis, self._slave_axis):
            if axis:
                axis.rearm()

    def enable(self) -> bool:
        """Enable both drives, and start the motion of the operator's hand.

        Returns
        -------
        bool
            Whether a force-commanded handle is at rest. Other drives are enabled without delay.
        """
        for axis in (self._axis, self._slave_axis):
            if axis and not axis.enable():
                return False
        self._enabled, self._error = True, ""
        self._start = self._commanded = self._time
        return True

    def write(self, command: Command) -> Command:
        """Send velocities to the two drives; return the velocities with which the drives move.

        The velocities are limited to the largest velocity of the drives. If the drives are not
        enabled, the command has no effect, and the returned velocities are zero.

        Raises
        ------
        ValueError
            A velocity is not finite. The drives continue with the previous command.
        """
        master, slave = command
        if not (math.isfinite(master) and math.isfinite(slave)):
            raise ValueError(f"a velocity command must be finite, got {command}")
        if self._enabled:
            most = self._max_velocity
            if not (-most <= master <= most and -most <= slave <= most):
                command = Command(min(max(master, -most), most), min(max(slave, -most), most))
            self._applied = command
            self._commanded = self._time
            if self._axis:
                self._axis.command(command.master_velocity, self._time)
            if self._slave_axis:
                self._slave_axis.command(command.slave_velocity, self._time)
        return self._applied

    def idle(self) -> bool:
        """Disable both drives, and stop them; return True. The operator lets go of the handle."""
        self._enabled = False
        self._applied = STANDSTILL
        self._start = math.inf
        for axis in (self._axis, self._slave_axis):
            if axis:
                axis.idle()
        return True

    def close(self) -> None:
        """Do nothing: a simulated rig has no resources to release."""
