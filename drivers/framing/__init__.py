"""Framing: where a frame begins and ends in a stream of bytes, and whether it is intact."""
