"""Run a trial: check the settings, assemble the parts, and run the control loop."""
