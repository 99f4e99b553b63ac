"""Find isolated spikes of the force: single samples with values that no motion explains."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from teleop.evaluation.batch.thresholds import (
    LEAST_SPIKE,
    MOST_SPIKES,
    SPIKE_NEIGHBOURS,
    SPIKE_SCATTER,
)
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.reason import Reason

NEAR = 5
"""Length of the median filter with which a sample is compared [samples]."""


def without_spikes(signals: Signals) -> tuple[Signals, list[Reason]]:
    """Return the record without the samples at which the force has an isolated spike."""
    f = signals.f
    if len(f) < 3 * NEAR:
        return signals, []
    away = np.abs(f - median_filter(f, NEAR, mode="nearest"))
    low, high = np.percentile(f, [1.0, 99.0])
    scatter = 1.4826 * float(np.median(away))
    found = away > max(LEAST_SPIKE * float(high - low), SPIKE_SCATTER * scatter)
    before, after = np.roll(f, 1), np.roll(f, -1)
    found &= away > SPIKE_NEIGHBOURS * np.abs(after - before)
    found &= ~(np.roll(found, 1) | np.roll(found, -1))
    found[[0, -1]] = False
    count = int(np.count_nonzero(found))
    if not 0 < count <= max(1, MOST_SPIKES * len(f)):
        return signals, []
    kept = ~found
    t = signals.t[kept]
    gaps = tuple(int(np.count_nonzero(kept[:gap])) for gap in signals.gaps)
    text = (
        f"the force has {count} isolated {'spike' if count == 1 else 'spikes'} of up to "
        f"{float(away[found].max()):.3g} N, each in a single sample: outliers, which are not used"
    )
    return signals._replace(t=t, x=signals.x[kept], f=f[kept], dt=periods(t), gaps=gaps), [
        Reason(text)
    ]
