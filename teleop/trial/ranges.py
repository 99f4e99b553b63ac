"""Ranges of the settings of a trial."""

from __future__ import annotations

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the loop [Hz]. Below the lowest rate, the hand of the operator and the
admittance are not stable together."""
DEEPEST = 0.1
"""Largest depth of palpation [m]."""
LONGEST = 3600.0
"""Longest duration of a trial [s].

The summary reads all ticks into memory, 0.4 MB per second at 1 kHz.
"""
LONGEST_NAME = 100
"""Largest number of characters of the name of a specimen or an operator."""
LONGEST_NOTES = 10_000
"""Largest number of characters of the notes."""
