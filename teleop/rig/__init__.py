"""Work with a rig before a trial: check, tare, emulation, and lag of the force channel."""
