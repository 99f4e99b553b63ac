"""Recordings: the message of a tick, the recorder, MCAP files."""
