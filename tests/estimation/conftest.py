"""Common signals for the tests of the estimators."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray


class Signals(NamedTuple):
    x: NDArray[np.float64]
    v: NDArray[np.float64]
    f: NDArray[np.float64]
    dt: NDArray[np.float64]


def palpation(
    seconds: float = 2.0,
    b: float = 20.0,
    k: float = 2100.0,
    noise: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> Signals:
    """Return two sines about a depth on a linear Kelvin-Voigt plant, at 1 kHz."""
    rng = np.random.default_rng(seed)
    n = round(seconds * 1000)
    dt = 1e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n))
    t = np.cumsum(dt)
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    return Signals(x, v, b * v + k * x + rng.normal(0.0, noise, n), dt)


@pytest.fixture(name="palpation")
def palpation_fixture():
    return palpation
