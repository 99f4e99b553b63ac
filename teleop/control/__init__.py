"""Compute one tick of the control loop, from a measurement to the commands for the drives."""
