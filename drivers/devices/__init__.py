"""Drivers of the devices of a rig (the hardware). Each kind of device has its own module."""
