"""Rigs before a trial: rig files, check, tare, emulation, lag of the force channel."""
