"""Compute the complex stiffness k' + i k'' of a sine whose frequency is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.transmission import TransmissionCalibration

LARGEST_DISTORTION = 0.03
"""Largest harmonics of the force with which the complex stiffness is stated. Play of a tenth of the
amplitude causes 4 %, and decreases k' by 5 %; play of a third causes 12 %, and 29 %."""
LONGEST_LAG = 20e-3
"""Longest lag of the force that is expected if it is not known [s]."""
LARGEST_ERROR = 0.3
"""Largest effect of an unknown lag on k', relative to k', with which k' is stated."""
FEWEST_SAMPLES = 16
"""Smallest number of samples in a cycle."""
DECREASE = 1.4
"""Decrease of k' by play, relative to the harmonics that it causes."""
FEWEST_CYCLES = 3
"""Smallest number of cycles from which intervals are computed."""


@dataclass(frozen=True)
class DynamicStiffness:
    """Storage and loss stiffness at a frequency, with 95 % intervals."""

    frequency: float
    """Frequency [Hz]."""
    amplitude: float
    """Amplitude of the position behind the lost motion [m]."""
    distortion: float
    """Third harmonic of the force that the motion does not explain, relative to the fundamental."""
    storage: float | None
    """Storage stiffness k' of specimen and transmission in series [N/m]; None if the force has too
    large harmonics."""
    storage_half: float | None
    """Half width of the interval of k' [N/m]."""
    loss: float | None
    """Loss stiffness k'' [N/m]; None if the lag of the force is not known."""
    loss_half: float | None
    """Half width of the interval of k'' [N/m]."""
    storage_tip: float | None
    """Storage stiffness at the tip [N/m]; None if the compliance is not known."""
    loss_tip: float | None
    """Loss stiffness at the tip [N/m]; None if compliance or lag is not known."""
    loss_tangent: float | None
    """Loss tangent k'' / k'; None if the lag of the force is not known."""
    reason: str = ""
    """Why k' or k'' is not determined; empty if both are."""


def dynamic_stiffness(
    t: Floats, x: Floats, f: Floats, frequency: float, known: TransmissionCalibration
) -> DynamicStiffness | None:
    """Return the complex stiffness of a sine; None if it has too few cycles or no amplitude.

    The intervals contain the scatter of the cycles, and the errors of the calibration.

    Parameters
    ----------
    t
        Times [s], shape (n,).
    x
        Position behind the lost motion [m], shape (n,).
    f
        Contact force [N], shape (n,), with the lag of the force channel.
    frequency
        Frequency of the sine [Hz].
    known
        Calibrated transmission. Its lag and compliance are corrected here.
    """
    omega = 2.0 * math.pi * frequency
    cycles = np.floor((t - t[0]) * frequency + 1e-9).astype(int)
    whole = math.floor((t[-1] - t[0]) * frequency + 1e-6)
    ratios, sizes, harmonics = [], [], []
    for cycle in range(whole):
        part = cycles == cycle
        if part.sum() < FEWEST_SAMPLES:
            return None
        angle = omega * t[part]
        waves = [np.ones(part.sum()), t[part] - t[0]]
        waves += [wave(n * angle) for n in (1, 2, 3) for wave in (np.cos, np.sin)]
        signals = np.column_stack([x[part], f[part]])
        found = np.linalg.lstsq(np.column_stack(waves), signals, rcond=None)[0]
        position, force = found[2] - 1j * found[3]
        if position == 0.0 or force == 0.0:
            return None
        ratios.append(force / position)
        sizes.append(abs(position))
        # Play is symmetrical, and causes odd harmonics; tissue that stiffens causes even ones. The
        # harmonic that a linear specimen makes of that of the position is not counted.
        third = found[6] - 1j * found[7]
        lag = known.response(3.0 * omega) / known.response(omega)
        harmonics.append((third[1] - force / position * lag * third[0]) / abs(force))
    if whole < FEWEST_CYCLES:
        return None
    complex_ratios = np.array(ratios) / known.response(omega)
    mean = complex(complex_ratios.mean())
    # the phase of a harmonic turns three times as fast as that of the fundamental
    distortion = float(np.mean(np.abs(harmonics)))
    amplitude = float(np.mean(sizes))
    scale = float(stdtrit(whole - 1, 0.975)) / math.sqrt(whole)
    both = (complex_ratios.real, complex_ratios.imag)
    by_noise = [scale * float(np.std(part, ddof=1)) for part in both]
    k, per_speed = mean.real, 4.0 / (math.pi * omega * amplitude)
    by_calibration = (
        known.stiffness_error(k, amplitude + known.lost_motion, omega),
        omega * known.damping_error(k, per_speed, omega),
    )
    halves = [math.hypot(*both) for both in zip(by_noise, by_calibration, strict=True)]
    # an error of the lag turns k' + i k''; an unknown lag may be up to LONGEST_LAG
    turn = omega * (known.force_lag_error if known.force_lag else LONGEST_LAG)
    by_lag = abs(mean.imag) * turn + 0.5 * abs(k) * turn * turn
    halves[0] = math.hypot(halves[0], by_lag)
    if not known.lost_motion:  # it may be the cause of the harmonics
        halves[0] = math.hypot(halves[0], DECREASE * distortion * abs(k))
    tip = None
    if known.compliance and abs(known.compliance * mean) < 1.0:
        tip = mean / (1.0 - known.compliance * mean)
    if by_lag > LARGEST_ERROR * abs(k):
        reason = (
            "k' and k'' are not determined, because the lag of the force is not known: a lag of "
            f"{1e3 * LONGEST_LAG:g} ms would change k' by {by_lag / abs(k):.0%}"
        )
        return DynamicStiffness(frequency, amplitude, distortion, *(None,) * 7, reason)
    if distortion > LARGEST_DISTORTION:
        reason = (
            f"k' is not determined: the force has harmonics of {distortion:.0%}, as with lost "
            "motion between position sensor and tip (teleop lag --stiffness measures it), loss of "
            "contact, or an amplitude at which the specimen is not linear"
        )
        return DynamicStiffness(frequency, amplitude, distortion, *(None,) * 7, reason)
    values = (frequency, amplitude, distortion, mean.real, halves[0])
    if not known.force_lag:
        reason = (
            "k'' is not determined, because the lag of the force is not known: each millisecond "
            f"makes it smaller by {1e-3 * omega * k:.3g} N/m"
        )
        storage_tip = None if tip is None else tip.real
        return DynamicStiffness(*values, None, None, storage_tip, None, None, reason)
    tip_parts = [None, None] if tip is None else [tip.real, tip.imag]
    tangent = mean.imag / k if k else None
    return DynamicStiffness(*values, mean.imag, halves[1], tip_parts[0], tip_parts[1], tangent)
