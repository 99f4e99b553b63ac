"""Compute the complex stiffness k' + i k'' of a sine: the ratio of the fundamentals of f and x."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import FEWEST_LOCK_IN, MOST_LOCK_IN


class ComplexStiffness(NamedTuple):
    """Storage and loss stiffness at a frequency, with half widths of their 95 % intervals [N/m]."""

    storage: float
    storage_half: float
    loss: float
    loss_half: float


def complex_stiffness(record: SmoothedRecord) -> ComplexStiffness | None:
    """Return the complex stiffness of a sinusoidal record; None if it has too few cycles.

    The record is divided into blocks of whole cycles. The fundamental of force and position is
    fitted to each block, with a straight line. The scatter of the blocks gives the intervals. Both
    signals were smoothed by the same kernel, which does not change their ratio.
    """
    frequency = record.frequency
    length = 1.0 / (frequency * record.period)  # of a cycle [samples]
    ratios = []
    bounds = [*record.starts, len(record.t)]
    total = sum(int((end - start) / length) for start, end in pairwise(bounds))
    each = max(1, total // MOST_LOCK_IN)  # cycles of a block
    for start, end in pairwise(bounds):
        for i in range(int((end - start) / (length * each))):
            first, last = (start + round(j * each * length) for j in (i, i + 1))
            t = record.clock[first:last]
            phase = 2.0 * math.pi * frequency * t
            line = np.linspace(-1.0, 1.0, len(t))
            columns = np.column_stack([np.cos(phase), np.sin(phase), np.ones(len(t)), line])
            signals = np.column_stack([record.x[first:last], record.f[first:last]])
            cosine, sine = np.linalg.lstsq(columns, signals, rcond=None)[0][:2]
            position, force = cosine - 1j * sine
            ratios.append(force / position)
    n = len(ratios)
    if n < FEWEST_LOCK_IN:
        return None
    found = np.array(ratios)
    scale = float(stdtrit(n - 1, 0.975)) / math.sqrt(n)
    return ComplexStiffness(
        float(found.real.mean()),
        scale * float(np.std(found.real, ddof=1)),
        float(found.imag.mean()),
        scale * float(np.std(found.imag, ddof=1)),
    )
