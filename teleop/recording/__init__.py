"""Recordings of trials: message of a tick, recorder, MCAP files."""
