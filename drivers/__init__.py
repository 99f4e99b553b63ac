"""Drivers: what a rig is to the controller, and the devices behind it."""

from drivers.rig import CHANNELS, STANDSTILL, Ages, Command, Measurement, Rig, RigError

__all__ = ["CHANNELS", "STANDSTILL", "Ages", "Command", "Measurement", "Rig", "RigError"]
