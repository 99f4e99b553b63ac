"""Smooth position, velocity and force with the same Gaussian kernel, without phase shift.

If f = b v + k x, then H f = b H v + k H x for every linear filter H. Here H is the convolution with
a Gaussian kernel. The kernel is symmetric, so that H causes no delay. All signals are filtered by
the same H, so that H causes no bias in b or k. The smoothed velocity H v is the convolution of the
measured position with the derivative of the kernel. Its noise is smaller than that of a difference
quotient of the position.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from estimation.arrays import Floats

REACH = 5.0
"""Half length of the Gaussian kernel, in standard deviations of the kernel."""
CORNER = 0.13252
"""Half-power frequency [Hz] of a Gaussian kernel whose standard deviation is 1 s."""


def kernel_width(bandwidth: float) -> float:
    """Return the standard deviation [s] of a Gaussian kernel.

    `bandwidth` is the half-power frequency of the kernel [Hz].
    """
    return CORNER / bandwidth


def smooth(values: Floats, width: float) -> Floats:
    """Return the values smoothed with a Gaussian kernel, shape (n,).

    The signal is extended at both ends by point reflection at the first and at the last sample.

    The samples have a constant rate, and `width` is in samples.
    """
    return _convolve(values, smoothing_kernel(width))


def smooth_pieces(values: Floats, starts: Sequence[int], width: float) -> Floats:
    """Smooth the pieces of a signal separately, and return the whole smoothed signal, shape (n,).

    A piece is the part of the signal between two gaps, where samples are missing.

    `starts` contains the index of the first sample of each piece.
    """
    return np.concatenate([smooth(piece, width) for piece in np.split(values, starts[1:])])


def slope(values: Floats, width: float, period: float) -> Floats:
    """Smooth a signal with a Gaussian kernel, and return its time derivative, shape (n,).

    The unit of the derivative is the unit of the signal per second.

    `width` is in samples, and `period`, the sample period, in seconds.
    """
    return _convolve(values, slope_kernel(width, period))


@lru_cache(maxsize=8)
def smoothing_kernel(width: float) -> Floats:
    """Return the Gaussian kernel with a standard deviation of `width` samples, of odd length."""
    half = int(np.ceil(REACH * width))
    if width <= 0.1:
        return read_only(np.ones(1))
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return read_only(kernel / kernel.sum())


def read_only(kernel: Floats) -> Floats:
    """Return a kernel that nobody can change, since all callers share it."""
    kernel.setflags(write=False)
    return kernel


def slope_kernel(width: float, period: float) -> Floats:
    """Return the derivative of the Gaussian kernel [1/s]; without smoothing, a central difference.

    Its convolution with a straight line is exactly the slope of the line.
    """
    kernel = smoothing_kernel(width)
    half = len(kernel) // 2
    if half == 0:
        return np.array([0.5, 0.0, -0.5]) / period
    derivative = -np.arange(-half, half + 1) * kernel
    return np.asarray(derivative / (-(derivative @ np.arange(-half, half + 1)) * period))


def _convolve(values: Floats, kernel: Floats) -> Floats:
    half = len(kernel) // 2
    if half == 0:
        return values.copy()
    padded = extended(values, half)
    if len(kernel) < 200:
        return np.asarray(np.convolve(padded, kernel, mode="valid"))
    from scipy.signal import oaconvolve

    return np.asarray(oaconvolve(padded, kernel, mode="valid"))


def extended(values: Floats, count: int) -> Floats:
    """Extend signals (..., n) at both ends by `count` samples, by point reflection at the end.

    `numpy.pad` gives the same numbers, but takes longer than the smoothing of a short signal.
    """
    if count >= values.shape[-1]:
        widths = [(0, 0)] * (values.ndim - 1) + [(count, count)]
        return np.pad(values, widths, mode="reflect", reflect_type="odd")
    before = 2.0 * values[..., :1] - values[..., count:0:-1]
    after = 2.0 * values[..., -1:] - values[..., -2 : -count - 2 : -1]
    return np.concatenate([before, values, after], axis=-1)
