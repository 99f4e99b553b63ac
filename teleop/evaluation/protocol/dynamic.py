"""Compute the complex stiffness k' + i k'' of a sine whose frequency is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from estimation.arrays import Floats
from estimation.transmission import TransmissionCalibration

FEWEST_CYCLES = 3
"""Smallest number of cycles from which intervals are computed."""


@dataclass(frozen=True)
class DynamicStiffness:
    """Storage and loss stiffness at a frequency, with 95 % intervals."""

    frequency: float
    """Frequency [Hz]."""
    amplitude: float
    """Amplitude of the position behind the lost motion [m]."""
    storage: float
    """Storage stiffness k' of specimen and transmission in series [N/m]."""
    storage_half: float
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
    """Why k'' is not determined; empty if it is."""


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
    ratios, sizes = [], []
    for cycle in range(whole):
        part = cycles == cycle
        if part.sum() < 6:
            return None
        waves = np.column_stack(
            [np.cos(omega * t[part]), np.sin(omega * t[part]), np.ones(part.sum()), t[part] - t[0]]
        )
        coefficients = np.linalg.lstsq(waves, np.column_stack([x[part], f[part]]), rcond=None)[0]
        position, force = coefficients[0] - 1j * coefficients[1]
        if position == 0.0:
            return None
        ratios.append(force / position)
        sizes.append(abs(position))
    if whole < FEWEST_CYCLES:
        return None
    found = np.array(ratios) / known.response(omega)
    mean = complex(found.mean())
    amplitude = float(np.mean(sizes))
    scale = float(stdtrit(whole - 1, 0.975)) / math.sqrt(whole)
    by_noise = [scale * float(np.std(part, ddof=1)) for part in (found.real, found.imag)]
    k, per_speed = mean.real, 4.0 / (math.pi * omega * amplitude)
    by_calibration = (
        known.stiffness_error(k, amplitude + known.lost_motion, omega),
        omega * known.damping_error(k, per_speed, omega),
    )
    halves = [math.hypot(*both) for both in zip(by_noise, by_calibration, strict=True)]
    tip = None
    if known.compliance and abs(known.compliance * mean) < 1.0:
        tip = mean / (1.0 - known.compliance * mean)
    values = (frequency, amplitude, mean.real, halves[0])
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
