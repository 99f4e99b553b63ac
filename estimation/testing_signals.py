"""Make test signals for the checks of estimators in `estimation.testing`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.estimator import Estimator


class Signals(NamedTuple):
    """Signals of n samples. They are the arguments of `Estimator.run`."""

    x: Floats
    """Displacement [m], shape (n,)."""
    v: Floats
    """Velocity [m/s], shape (n,)."""
    f: Floats
    """Force [N], shape (n,)."""
    dt: Floats
    """Time since the previous sample [s], shape (n,)."""
    further: Floats | None = None
    """The model's regressors besides v and x, shape (n, regressors - 2)."""


def palpation(estimator: Estimator, n: int = 2000, noise: float = 0.1, seed: int = 0) -> Signals:
    """Return the signals of a palpation of a Kelvin-Voigt body, with noise and uneven sampling.

    The displacement is a sum of two sines around a depth of 5 mm.

    Parameters
    ----------
    estimator
        Estimator whose model defines the regressors besides v and x.
    n
        Number of samples.
    noise
        Standard deviation of the force noise [N].
    seed
        Seed of the noise and of the sample times.
    """
    rng = np.random.default_rng(seed)
    dt = 1e-3 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, n))
    t = np.cumsum(dt)
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    f = 20.0 * v + 2100.0 * x + rng.normal(0.0, noise, n)
    return Signals(x, v, f, dt, further_regressors(estimator, x, v, f))


def further_regressors(estimator: Estimator, x: Floats, v: Floats, f: Floats) -> Floats | None:
    """Return test values of the regressors that the estimator's model has besides v and x.

    The result has the shape (n, regressors - 2). It is None if the model has only v and x.
    """
    known = {"f0": np.ones_like(x), "m": 10.0 * v, "k3": x**3, "tau": -10.0 * f}
    columns = [known[parameter] for parameter in estimator.model.further]
    return np.column_stack(columns) if columns else None


def degenerate(estimator: Estimator) -> Iterator[Signals]:
    """Yield signals that can cause a division by zero, an overflow or an underflow.

    Displacement, velocity and force are zero, constant, sinusoidal or random. Their magnitudes are
    between 1e-300 and 1e9, and the sample periods are between 1e-9 s and 1e6 s.
    """
    rng = np.random.default_rng(0)
    n = 24
    zero, one, wave = np.zeros(n), np.ones(n), np.sin(np.arange(n))
    random = rng.normal(size=n)
    for x, v, f in (
        (zero, zero, zero),
        (zero, zero, one),
        (one, zero, zero),
        (one, zero, one),
        (zero, one, one),
        (one, one, one),
        (one, -one, zero),
        (wave, zero, wave),
        (wave, wave, wave),
        (wave, -wave, one),
        (zero, wave, random),
        (random, random, zero),
    ):
        for size in (1.0, 1e-9, 1e-80, 1e-160, 1e-300, 1e9):
            for period in (1e-9, 1e-3, 1e6):
                xs, vs, fs = size * x, size * v, size * f
                further = further_regressors(estimator, np.clip(xs, -1e6, 1e6), vs, fs)
                yield Signals(xs, vs, fs, np.full(n, period), further)


def held_and_gaps(s: Signals) -> Iterator[Signals]:
    """Yield two variants of the signals `s`.

    In the first variant, x, v and f are zero for 200 samples. In the second variant, the time
    between two samples is 0.5 s at one sample, 100 s at another, and 1 us at a third.
    """
    moving = np.ones_like(s.x)
    moving[200:400] = 0.0
    yield Signals(s.x * moving, s.v * moving, s.f * moving, s.dt, s.further)
    dt = s.dt.copy()
    dt[[300, 800, 801]] = (0.5, 100.0, 1e-6)
    yield s._replace(dt=dt)
