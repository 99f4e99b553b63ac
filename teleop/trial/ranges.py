"""Define the permitted ranges of the settings of a trial."""

from __future__ import annotations

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the control loop [Hz]. Below the lowest rate, the coupled system of
hand and admittance is unstable."""
DEEPEST = 0.1
"""Largest depth of palpation [m]."""
DURATION = 3600.0
"""Longest duration of a trial [s].

It is limited because the summary reads all ticks into memory: 0.4 MB per second at 1 kHz.
"""
NAME = 100
"""Largest number of characters of the name of a specimen or an operator."""
NOTES = 10_000
"""Largest number of characters of the notes."""
FREQUENCY = {"mimic": 1.0, "autonomous": 2.0}
"""Frequency of the sine [Hz] if the settings have no signal, by condition."""
COUNT_IN = 3.0
"""Time at the start of a `mimic` trial in which the target does not move, on a hardware rig [s]."""
