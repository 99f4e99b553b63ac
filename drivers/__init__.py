"""Drivers: the interface between the controller and a rig, and the devices of a rig."""

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
