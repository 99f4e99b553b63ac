"""Run a trial: assemble the parts from the settings, and run the control loop."""
