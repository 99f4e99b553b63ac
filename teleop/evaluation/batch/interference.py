"""Find interference, such as hum from the mains, in the force of a sinusoidal palpation.

The force of a body has the frequency of the motion and its harmonics. A line of the spectrum
between the harmonics, without such a line in the position, is interference. A harmonic of the third
or a higher order is also interference if the harmonics near it are much smaller, except a third
harmonic with the phase of an elastic force: a specimen that is equally stiff in both directions has
no other.
Interference at the frequency of the motion, and at twice this frequency, cannot be distinguished
from the force of a body.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from estimation.arrays import Floats
from teleop.evaluation.batch.smoothed_record import SmoothedRecord
from teleop.evaluation.batch.thresholds import (
    CUBIC_PHASE,
    FEWEST_LINE_CYCLES,
    LEAST_LINE,
    LINE_FLOOR,
    LINE_NEIGHBOURS,
    LINE_RESPONSE,
    LINE_WIDTH,
)


class Line(NamedTuple):
    """A line of the spectrum of the force that the motion does not cause."""

    frequency: float
    """Frequency in the record [Hz]; that of the source can be higher (aliasing)."""
    amplitude: float
    """Amplitude [N]."""
    harmonic: int
    """Order of the harmonic of the motion that the line coincides with; 0 for none."""

    @property
    def text(self) -> str:
        """Sentence for the user that describes the interference."""
        where = f"{self.amplitude:.3g} N at {self.frequency:.4g} Hz"
        if self.harmonic:
            return (
                f"interference: the force has a line of {where}, {self.harmonic} times the "
                "frequency of the motion, which neither the motion nor the harmonics near it "
                "explain: the dependence of the force on the position is not determined"
            )
        return (
            f"interference: the force has a line of {where} that the position does not have, for "
            "example hum from the mains at this frequency or, by aliasing, at a higher one"
        )


def interference(record: SmoothedRecord) -> Line | None:
    """Return the largest line of interference in the force; None if there is none."""
    n = len(record.t)
    if not record.sinusoidal or len(record.starts) > 1 or not math.isfinite(record.frequency):
        return None
    if n * record.period * record.frequency < FEWEST_LINE_CYCLES:
        return None
    window = np.hanning(n)
    force, position = (
        np.abs(np.fft.rfft(window * (values - values.mean()))) * 2.0 / window.sum()
        for values in (record.raw_f, record.raw_x)
    )
    step = 1.0 / (n * record.period)
    motion = int(np.argmax(position[LINE_WIDTH:])) + LINE_WIDTH
    stiffness = float(force[motion] / position[motion])
    last = len(force) - LINE_WIDTH - 1
    least = LEAST_LINE * float(np.ptp(record.f))
    floor = median_filter(force, 8 * LINE_WIDTH + 1, mode="nearest")
    high = (force > least) & (force > LINE_FLOOR * floor)
    high &= force > LINE_RESPONSE * stiffness * position
    exact = record.frequency / step
    found = []
    for i in np.flatnonzero(high[: last + 1]):
        part = force[max(i - LINE_WIDTH, 0) : i + LINE_WIDTH + 1]
        order = round(i / exact)
        if i < motion // 2 or force[i] < part.max() or max(part[0], part[-1]) > 0.25 * force[i]:
            continue
        if abs(i - order * exact) > LINE_WIDTH:
            found.append(Line(i * step, float(force[i]), 0))
        elif order > 2 and is_alone(force, exact, order) and not is_cubic(record, order):
            found.append(Line(i * step, float(force[i]), order))
    return max(found, key=lambda line: line.amplitude, default=None)


def is_cubic(record: SmoothedRecord, order: int) -> bool:
    """Return whether a line is a third harmonic with the phase of the cube of the position."""
    if order != 3:
        return False
    t = record.clock - record.clock.mean()
    window = np.hanning(len(t))
    fundamental, third = (
        complex(
            (window * (values - values.mean())) @ np.exp(-2j * np.pi * n * record.frequency * t)
        )
        for values, n in ((record.raw_x, 1), (record.raw_f, 3))
    )
    ratio = third * (abs(fundamental) / fundamental) ** 3
    return abs(ratio.imag) < CUBIC_PHASE * abs(ratio)


def is_alone(force: Floats, motion: float, order: int) -> bool:
    """Return whether the harmonics near a harmonic are much smaller; `motion` is in bins."""
    sizes = {}
    for near in range(max(2, order - 2), order + 3):
        middle = round(near * motion)
        part = force[middle - LINE_WIDTH // 2 : middle + LINE_WIDTH // 2 + 1]
        sizes[near] = float(part.max()) if len(part) else 0.0
    others = [size for near, size in sizes.items() if near != order]
    return sizes[order] > LINE_NEIGHBOURS * max(others)
