"""Codecs: from a frame's bytes to SI units and back, pure functions."""
