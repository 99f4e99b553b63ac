"""Emulated devices. Each module emulates the device of the driver in `drivers.devices`."""
