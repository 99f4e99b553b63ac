"""Find interference, such as hum from the mains, in the force of a sinusoidal palpation.

The force of a body has the frequency of the motion and its harmonics. A line of the spectrum
between the harmonics, without such a line in the position, is interference. A harmonic of the third
or a higher order is also interference if the harmonics near it are much smaller, except a third
harmonic with the phase of an elastic force: a specimen that is equally stiff in both directions has
no other.
Other interference at the harmonics, and at the frequency of the motion, cannot be distinguished
from the force of a body. It is possible if the sampling rate is low, and aliasing moves the
frequency of the mains to one of these frequencies.
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

MAINS = (50.0, 60.0)
"""Frequencies of the mains [Hz]."""


class Line(NamedTuple):
    """A line of the spectrum of the force that the motion does not cause."""

    frequency: float
    """Frequency in the record [Hz]; that of the source can be higher (aliasing)."""
    amplitude: float
    """Amplitude [N]."""
    harmonic: int
    """Order of the harmonic of the motion that the line coincides with; 0 for none."""
    mains: float = 0.0
    """Frequency of the mains that aliasing moves to this frequency [Hz]; 0 for another source."""

    @property
    def hides_stiffness(self) -> bool:
        """Whether the dependence of the force on the position is not determined."""
        return self.harmonic > 1

    @property
    def text(self) -> str:
        """Sentence for the user that describes the interference."""
        where = f"{self.amplitude:.3g} N at {self.frequency:.4g} Hz"
        if self.mains:
            alias = f"hum of {self.mains:g} Hz appears at {self.frequency:.4g} Hz by aliasing, "
            if self.harmonic == 1:
                return (
                    f"interference is possible: {alias}the frequency of the motion, and would "
                    "change k and b. Expected another sampling rate"
                )
            return (
                f"interference is possible: {alias}{self.harmonic} times the frequency of the "
                f"motion, where the force has {self.amplitude:.3g} N: the dependence of the force "
                "on the position is not determined. Expected another sampling rate"
            )
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
    if hum := mains_at_harmonic(record):
        return hum
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


def mains_at_harmonic(record: SmoothedRecord) -> Line | None:
    """Return the force at a harmonic of the motion to which aliasing moves hum; otherwise None.

    The mean of several samples removes frequencies near a multiple of the frequency of the grid.
    """
    rate, motion = 1.0 / record.sampling_period, record.frequency
    for mains in MAINS:
        alias = abs(mains - rate * round(mains / rate))
        order = round(alias / motion)
        same = abs(alias - order * motion) * len(record.t) * record.period < 1.0
        if mains < 0.5 * rate or not order or not same:
            continue
        amplitude = abs(component(record, record.raw_f, order))
        if amplitude > LEAST_LINE * float(np.ptp(record.f)):
            return Line(alias, amplitude, order, mains)
    return None


def component(record: SmoothedRecord, values: Floats, order: int) -> complex:
    """Return the complex amplitude of a signal at a multiple of the frequency of the motion."""
    t = record.clock - record.clock.mean()
    window = np.hanning(len(t))
    wave = np.exp(-2j * np.pi * order * record.frequency * t)
    return complex((window * (values - values.mean())) @ wave) * 2.0 / float(window.sum())


def is_cubic(record: SmoothedRecord, order: int) -> bool:
    """Return whether a line is a third harmonic with the phase of the cube of the position."""
    if order != 3:
        return False
    fundamental, third = component(record, record.raw_x, 1), component(record, record.raw_f, 3)
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
