"""Connect the controller to a rig: the interface of all rigs, and the drivers of real devices."""

from drivers.rig import (
    AXES,
    CHANNELS,
    STANDSTILL,
    UNITS,
    Ages,
    Command,
    Measurement,
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
    "Rig",
    "RigError",
    "new_tuple",
]
