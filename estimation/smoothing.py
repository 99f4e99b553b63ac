"""Zero-phase smoothing of records: position, velocity and force behind one Gaussian kernel.

With H a filter, f = b v + k x implies H f = b H v + k H x. A Gaussian kernel and its derivative
give H x and H v from the position as measured, without a delay, so that neither parameter is
biased and the noise of a differentiated position is suppressed as that of the force is.
"""

from __future__ import annotations

import numpy as np

from estimation.compiled import Floats

REACH = 4.0
"""Half length of the kernel in standard deviations."""
CORNER = 0.13252
"""Frequency at which the kernel of a standard deviation of 1 s has half of the power [Hz]."""


def kernel_width(bandwidth: float) -> float:
    """Return the standard deviation [s] of the kernel whose half-power frequency this is [Hz]."""
    return CORNER / bandwidth


def smooth(values: Floats, width: float) -> Floats:
    """Return the values behind a Gaussian kernel; at the ends the line there goes on.

    Parameters
    ----------
    values
        Evenly sampled, shape (n,).
    width
        Standard deviation of the kernel [samples].
    """
    return _convolve(values, _kernel(width))


def slope(values: Floats, width: float, period: float) -> Floats:
    """Return the derivative of the values behind a Gaussian kernel [1/s].

    Parameters
    ----------
    values
        Evenly sampled, shape (n,).
    width
        Standard deviation of the kernel [samples].
    period
        Sample period [s].
    """
    kernel = _kernel(width)
    half = len(kernel) // 2
    if half == 0:
        return np.gradient(values, period)
    derivative = -np.arange(-half, half + 1) * kernel
    derivative /= -(derivative @ np.arange(-half, half + 1)) * period
    return _convolve(values, derivative)


def _kernel(width: float) -> Floats:
    half = int(np.ceil(REACH * width))
    if width <= 0.1:
        return np.ones(1)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return np.asarray(kernel / kernel.sum())


def _convolve(values: Floats, kernel: Floats) -> Floats:
    half = len(kernel) // 2
    if half == 0:
        return values.copy()
    padded = np.pad(values, half, mode="reflect", reflect_type="odd")
    if len(kernel) < 200:
        return np.asarray(np.convolve(padded, kernel, mode="valid"))
    from scipy.signal import oaconvolve

    return np.asarray(oaconvolve(padded, kernel, mode="valid"))
