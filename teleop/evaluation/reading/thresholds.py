"""Thresholds for the samples of a file."""

from __future__ import annotations

SMALLEST_CHANNEL = 1e-30
"""A channel whose values are all smaller is refused, because their squares would be zero."""
SHORTEST_PERIOD = 1e-9
"""Shortest sample period [s]."""
FEWEST_TABLE_SAMPLES = 3
"""Smallest number of samples in a table."""
COARSE_TIMES = 0.1
"""The option `--rate` is suggested if more than this fraction of the samples has the same time as
the previous sample."""
LONG_PERIOD = 20.0
"""A sample period is a gap if it is longer than this multiple of the median period."""
ROUNDING_OF_STEP = 1e-12
"""Steps smaller than this fraction of the largest value are treated as rounding errors."""
