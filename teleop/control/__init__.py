"""One tick of the control loop: from a measurement to commands for the drives."""
