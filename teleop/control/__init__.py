"""One tick: from a measurement to commands for the drives."""
