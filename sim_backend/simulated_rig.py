"""The simulated rig: a plant with sensors, drives and an operator."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from drivers import CHANNELS, STANDSTILL, Ages, Command, Measurement, Rig, new_tuple
from sim_backend.body import Body
from sim_backend.hand import Hand
from sim_backend.operators import ARM
from sim_backend.plant import UNATTENDED, Arm, Plant, PlantParameters
from sim_backend.sensors import Sensors

FRESH = Ages(*(0.0 for _ in CHANNELS))


class SimulatedRig(Rig):
    """A simulated telemanipulator with the interface of a real rig.

    Each call of `read` advances the plant to the present time of the clock, real or virtual. With
    a virtual clock, two simulations with the same seed are identical to the bit.

    Parameters
    ----------
    body
        The environment, such as a cube.
    now
        Function that returns the time of the clock [s].
    operator
        The hand that moves the handle; None if nobody holds it.
    parameters
        Parameters of drives and force channels.
    sensors
        Imperfections of the sensors.
    max_velocity
        Largest velocity of the drives [m/s].
    watchdog
        Watchdog time [s]. If enabled drives receive no command for a longer time, they stop. The
        measurement then contains the drive error `watchdog`. The drives stay disabled until they
        are enabled again.
    seed
        Seed of the sensor noise.
    start
        Initial position of the slave [m].
    arm
        Impedance of the operator's arm.

    Raises
    ------
    ValueError
        `max_velocity` or `watchdog` is not positive.
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
    ) -> None:
        for name, value in (("max_velocity", max_velocity), ("watchdog", watchdog)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        self.plant = Plant(body, parameters or PlantParameters(), arm if operator else UNATTENDED)
        self.plant.slave.move_to(start, 0.0)
        if operator:
            operator.handle = self.plant.handle
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
        """Set the time of the plant to the present time of the clock. The drives are disabled."""
        self._time = self._now()

    def read(self) -> Measurement:
        """Advance the plant to the time of the clock, and read every sensor."""
        now = self._now()
        if now > self._time:
            intended = None
            if self._operator and now >= self._start:
                intended = self._operator.intention(now - self._start)
            silent = self._commanded + self._watchdog
            if self._enabled and now > silent:
                if silent > self._time:
                    self.plant.advance(silent - self._time, self._applied, intended)
                    self._time = silent
                self.idle()
                self._error = "watchdog"
            self.plant.advance(now - self._time, self._applied, intended)
            self._time = now
            if self._operator and now >= self._start:
                handle, force = self.plant.handle, self.plant.master_force
                self._operator.feel(now - self._start, handle.x, force.y)
        plant, sensors, noise = self.plant, self._sensors, self._noise
        slave = plant.slave
        values = (
            now,
            sensors.force(plant.master_force.y, noise) + sensors.master_zero,
            sensors.position(plant.handle.x),
            sensors.position(slave.x + sensors.contact_position),
            sensors.force(plant.contact_force.y, noise) + sensors.contact_zero,
            slave.v,
            FRESH,
            self._error,
            False,
        )
        return new_tuple(Measurement, values)

    def rearm(self) -> None:
        """Clear the error of the watchdog."""
        self._error = ""

    def enable(self) -> bool:
        """Enable the drives, and start the motion of the operator; return True."""
        self._enabled, self._error = True, ""
        self._start = self._commanded = self._time
        return True

    def write(self, command: Command) -> Command:
        """Send the command to the drives; return the command that they apply.

        Velocities are limited to the largest velocity of the drives. Drives that are not enabled
        do not move.

        Raises
        ------
        ValueError
            A velocity is not finite; the previous command remains active.
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
        return self._applied

    def idle(self) -> None:
        """Disable both drives, and apply their brakes. The operator lets go of the handle."""
        self._enabled = False
        self._applied = STANDSTILL
        self._start = math.inf

    def close(self) -> None:
        """Do nothing: a simulated rig has no resources to release."""
