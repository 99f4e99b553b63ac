"""Emulated devices, one per file, for the drivers in `drivers.devices`."""
