"""Work on a rig before a trial: check, tare, emulation, lag of the force channel."""
