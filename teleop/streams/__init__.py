"""The stream of ticks, which the control loop writes to shared memory, and its readers."""
