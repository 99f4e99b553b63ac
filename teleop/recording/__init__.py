"""Recordings of trials: the message with the data of a tick, the recorder, and MCAP files."""
