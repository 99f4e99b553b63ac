"""Framing: separation of a stream of bytes into frames, and checksums."""
