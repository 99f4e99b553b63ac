"""Rigs before a trial: loading, check, tare, emulation, lag of the force channel."""
