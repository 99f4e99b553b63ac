"""Drivers: what a rig is to the controller, and the devices behind it."""

from drivers.rig import STANDSTILL, Ages, Command, Measurement, Rig

__all__ = ["STANDSTILL", "Ages", "Command", "Measurement", "Rig"]
