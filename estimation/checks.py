"""Check samples and settings. A failed check raises an error with a message of one line."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Samples
from estimation.model import Model

LARGEST = 1e30
"""Values of this magnitude or more are rejected, so that sums of squares do not overflow."""


def is_valid(dt: float, size: float) -> bool:
    """Return whether a sample is valid: `dt` [s], and `size`, the sum of the values' magnitudes."""
    return size < LARGEST and 0.0 < dt < math.inf


def sample_error(dt: float, further: Sequence[float] = (), **values: float) -> ValueError:
    """Return (do not raise) a ValueError with a message about an invalid sample.

    The message contains the names and values of all numbers of the sample: `dt`, the regressors
    `further` (those besides v and x), and the keyword arguments, for example `x=...`.
    """
    values |= {f"further[{i}]": value for i, value in enumerate(further)}
    got = ", ".join(f"{name}={value!r}" for name, value in values.items())
    return ValueError(
        f"a sample must be finite, below {LARGEST:g}, with dt > 0, got {got}, dt={dt!r}"
    )


def checked_samples(
    x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike, further: ArrayLike | None = None
) -> Samples:
    """Check n samples, and return them as contiguous float64 arrays.

    x [m], v [m/s] and f [N] have the shape (n,), `dt` [s] too or is one number, and `further` has
    the shape (n, regressors - 2) or is None. ValueError names the first invalid value.
    """
    shape = np.shape(x)
    if len(shape) != 1:
        raise ValueError(f"samples must be one-dimensional, x has shape {shape}")
    if np.ndim(dt) == 0:
        dt = np.full(shape, dt, dtype=np.float64)
    more = np.empty((*shape, 0)) if further is None else np.asarray(further, dtype=np.float64)
    if more.ndim != 2:
        raise ValueError(f"further regressors must be of shape (n, regressors), not {more.shape}")
    channels = {"x": x, "v": v, "f": f, "dt": dt}
    channels |= {f"further {i}": column for i, column in enumerate(more.T)}
    checked = {}
    for name, channel in channels.items():
        array = np.ascontiguousarray(channel, dtype=np.float64)
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}, but x has {shape}")
        good = (array > 0.0) & (array < np.inf) if name == "dt" else np.abs(array) < LARGEST
        if not good.all():
            n = int(np.argmin(good))
            expected = "a positive number" if name == "dt" else f"a finite number below {LARGEST:g}"
            raise ValueError(f"{name}[{n}] is {array[n]}, expected {expected}")
        checked[name] = array
    phi = np.column_stack((checked["v"], checked["x"], more))
    return Samples(phi, checked["f"], checked["dt"], np.ones(shape, dtype=np.bool_))


def check_positive(**settings: float) -> None:
    """Raise ValueError if a setting is not positive and finite."""
    for name, value in settings.items():
        if not 0.0 < value < math.inf:
            raise ValueError(f"{name.replace('_', ' ')} must be positive, got {value}")


def positive_values(name: str, values: Sequence[float], model: Model) -> tuple[float, ...]:
    """Check a setting that has one value per parameter of a model; return the values as a tuple."""
    if len(values) != model.regressors or not all(0.0 < value < math.inf for value in values):
        raise ValueError(
            f"{name} must be {model.regressors} positive numbers, for "
            f"{', '.join(model.parameters)}, got {tuple(values)}"
        )
    return tuple(values)


def check_size(name: str, size: float | None) -> None:
    """Raise ValueError if a typical magnitude is so small or large that its powers overflow.

    `name` is the name of the setting, for the message. None means that it is not set.
    """
    if size is not None and not 1.0 / LARGEST < size < LARGEST:
        raise ValueError(f"{name} must be between {1.0 / LARGEST:g} and {LARGEST:g}, got {size}")


def check_correlation(correlation: float) -> None:
    """Raise ValueError if `correlation` is below 1 or infinite.

    `correlation` describes the noise of the force. It is 1 for white noise. If the noise of
    successive samples is correlated, n samples contain only n / `correlation` independent values of
    the noise.
    """
    if not 1.0 <= correlation < math.inf:
        raise ValueError(f"correlation must be at least 1, got {correlation}")
