"""Drivers: what a rig is to the controller, and the devices behind it."""

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
]
