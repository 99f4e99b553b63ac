"""Codecs: pure functions that convert the bytes of serial or CAN frames to values, and back."""
