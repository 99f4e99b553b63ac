"""Devices, one per file; `drivers.registry` has them by name."""
