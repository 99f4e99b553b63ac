"""Devices, one per file. `drivers.registry` returns the class of a device for its kind."""
