"""Interface between the controller and a rig, and the drivers of real devices.

A rig is a telemanipulator with its sensors and drives, real or simulated.
"""

from drivers.rig import (
    AXES,
    CHANNELS,
    STANDSTILL,
    UNITS,
    Ages,
    Command,
    Measurement,
    NotStoppedError,
    Rig,
    RigError,
    new_tuple,
)

__all__ = [
    "AXES",
    "CHANNELS",
    "STANDSTILL",
    "UNITS",
    "Ages",
    "Command",
    "Measurement",
    "NotStoppedError",
    "Rig",
    "RigError",
    "new_tuple",
]
