"""Convert the values that a rig returns to floats.

A rig can return other types of numbers, for example integers. The safety supervisor needs floats.
"""

from __future__ import annotations

import math
from struct import Struct, error

from drivers import CHANNELS, Ages, Command, Measurement, RigError, new_tuple
from teleop.printable import one_line

FIRST_AGE = 1 + len(CHANNELS)
"""Index of the first age after the time and the channels of a measurement."""
SAMPLES, VELOCITIES = Struct(f"{FIRST_AGE + len(CHANNELS)}d"), Struct("2d")


def measurement_of(returned: Measurement) -> Measurement:
    """Return the measurement that a rig returned, with each number converted to a float.

    A value that is no number raises TypeError, and a time that is not finite RigError.
    """
    try:
        *samples, age, drive_error, emergency_stop = returned
        values = SAMPLES.unpack(SAMPLES.pack(*samples, *age))
        stop = bool(emergency_stop)
    except (TypeError, ValueError, error) as problem:
        raise TypeError(
            f"Rig.read returned {one_line(repr(returned))}: expected a Measurement of numbers"
        ) from problem
    if not math.isfinite(values[0]):
        raise RigError(f"the time of the measurement is {values[0]} s: expected a finite number")
    text = one_line(str(drive_error)) if drive_error else ""
    return new_tuple(
        Measurement, (*values[:FIRST_AGE], new_tuple(Ages, values[FIRST_AGE:]), text, stop)
    )


def command_of(returned: Command) -> Command:
    """Return the velocities that the drives of a rig applied, converted to floats.

    A value that is no number raises TypeError, and a velocity that is not finite RigError.
    """
    try:
        master, slave = VELOCITIES.unpack(VELOCITIES.pack(*returned))
    except (TypeError, error) as problem:
        raise TypeError(
            f"Rig.write returned {one_line(repr(returned))}: expected a Command of two velocities"
        ) from problem
    if not (math.isfinite(master) and math.isfinite(slave)):
        raise RigError(
            f"the rig applied the velocities {master} and {slave} m/s: expected finite numbers"
        )
    return new_tuple(Command, (master, slave))
