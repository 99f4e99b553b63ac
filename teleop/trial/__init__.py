"""A trial: its settings, the assembly of its parts, the control loop, and the run."""
