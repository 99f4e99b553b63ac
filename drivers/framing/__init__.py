"""Separate a stream of bytes into frames, and compute the checksums of frames."""
