"""Transports: what carries the bytes and frames between the controller and the devices."""
