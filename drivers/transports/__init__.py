"""Transports: serial ports and CAN buses between the controller and the devices."""
