"""Find isolated spikes of the force: single samples with values that no motion explains."""

from __future__ import annotations

import numpy as np

from teleop.evaluation.batch.thresholds import (
    FEWEST_IN_PIECE,
    LEAST_SPIKE,
    MOST_SPIKES,
    SPIKE_NEIGHBOURS,
    SPIKE_SCATTER,
)
from teleop.evaluation.reading.signals import Signals, selected
from teleop.evaluation.reason import Reason


def without_spikes(signals: Signals) -> tuple[Signals, list[Reason]]:
    """Return the record without the samples at which the force has an isolated spike."""
    f = signals.f
    if len(f) < FEWEST_IN_PIECE:
        return signals, []
    steps = np.diff(f)
    low, high = np.percentile(f, [1.0, 99.0])
    scatter = 1.4826 * float(np.median(np.abs(steps)))
    least = max(LEAST_SPIKE * float(high - low), SPIKE_SCATTER * scatter)
    to, back = steps[:-1], -steps[1:]  # of each sample but the first and the last
    size = np.where(to * back > 0.0, np.minimum(np.abs(to), np.abs(back)), 0.0)
    size[SPIKE_NEIGHBOURS * np.abs(to - back) > size] = 0.0
    away = np.concatenate([[0.0], size, [0.0]])
    found = away > least
    count = int(np.count_nonzero(found))
    if not 0 < count <= max(1, MOST_SPIKES * len(f)):
        return signals, []
    text = (
        f"the force has {count} isolated {'spike' if count == 1 else 'spikes'} of up to "
        f"{float(away[found].max()):.3g} N, each in a single sample: outliers, which are not used"
    )
    return selected(signals, ~found), [Reason(text)]
