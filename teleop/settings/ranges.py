"""Define the permitted ranges of the settings of a trial."""

from __future__ import annotations

RATES = (50.0, 100_000.0)
"""Lowest and highest rate of the control loop [Hz]. Below the lowest rate, the coupled system of
hand and admittance is unstable."""
DEEPEST = 0.1
"""Largest depth of palpation [m]."""
MOST_TICKS = 1 << 32
"""Largest number of ticks of a trial. The number of a tick in a recording has 32 bits."""
MOST_TICKS_IN_MEMORY = 3_600_000
"""Largest number of ticks of a trial that is not recorded. Its ticks are kept in memory, about
0.4 kB for each tick."""
NAME = 100
"""Largest number of characters of the name of a specimen or an operator."""
NOTES = 10_000
"""Largest number of characters of the notes."""
RATE = 1000.0
"""Rate of the control loop [Hz], if neither the settings nor a rig file state it."""
COUNT_IN = 3.0
"""Time at the start of a trial in which a target does not move, on a hardware rig [s]."""
