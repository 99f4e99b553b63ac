"""Compute the complex stiffness k' + i k'' of a sine: the ratio of the fundamentals of f and x."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from estimation.arrays import Floats
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import FEWEST_LOCK_IN, MOST_LOCK_IN, SHORTEST_LOCK_IN


class ComplexStiffness(NamedTuple):
    """Storage and loss stiffness at a frequency, with half widths of their 95 % intervals [N/m]."""

    storage: float
    storage_half: float
    loss: float
    loss_half: float


def complex_stiffness(
    record: SmoothedRecord, curved: Floats | None = None
) -> ComplexStiffness | None:
    """Return the complex stiffness of a sinusoidal record; None if it has too few cycles.

    `curved` is the part of the elastic force that is not proportional to the position [N]. It loses
    no energy, but if the motion is not an exact sine, such as behind lost motion, its fundamental
    has another phase than that of the position. The loss is computed without it.

    The record is divided into blocks of whole cycles, which overlap by half. With a Hann window
    over three cycles or more, neither the mean nor the harmonics change the fundamental. The
    scatter of the blocks gives the intervals. Both signals were smoothed by the same kernel, which
    does not change their ratio.
    """
    cycle = 1.0 / (record.frequency * record.period)  # [samples]
    bounds = [*record.starts, len(record.t)]
    total = sum(int((end - start) / cycle) for start, end in pairwise(bounds))
    length = round(cycle * max(SHORTEST_LOCK_IN, 2 * total // MOST_LOCK_IN))
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * np.arange(length) / length)
    wave = window * np.exp(-2j * math.pi / cycle * np.arange(length))
    bend = np.zeros(len(record.t)) if curved is None else curved
    ratios = []
    for start, end in pairwise(bounds):
        for first in range(start, end - length + 1, length // 2):
            block = slice(first, first + length)
            x, f, bent = (part[block] - part[block].mean() for part in (record.x, record.f, bend))
            force, other, position = wave @ f, wave @ bent, wave @ x
            ratios.append(complex((force / position).real, ((force - other) / position).imag))
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
