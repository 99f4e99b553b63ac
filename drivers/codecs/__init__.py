"""Codecs: pure functions that convert between the bytes of frames and values."""
