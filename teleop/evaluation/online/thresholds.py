"""Thresholds of the evaluation with the online estimators."""

from __future__ import annotations

# Samples and settings

FEWEST_SAMPLES = 10
"""Smallest number of moving samples that are evaluated."""
RESOLUTIONS = 1e-12, 1.0
"""Range of the setting `resolution` of `EstimateSettings` [m]."""
FARTHEST_ANALYSED = 1.0
"""Distance from the next analysed sample above which a time is between two analysed sections [s].

The analysis of a long record contains only sections of the record. The distance must also exceed
two sample periods of the analysis.
"""

# Remarks and comparison

LEAST_KEPT_VARIANCE = 0.9
"""A message is reported if the conditioning keeps less than this fraction of the force variance."""
WINDOW = 1.0
"""Length of the sliding window of batch least squares [s]. The force prediction errors of all
estimators are divided by the error of this method. A time of the same length is omitted at the
start of the record."""
ROUNDING_OF_FORCE = 1e-9
"""If the error of batch least squares is below this fraction of the force, it is only a rounding
error, and no error is divided by it: `Comparison.one_step_ratio` is NaN."""
