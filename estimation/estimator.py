"""What every estimator is: a pure step on scalars, run for one sample or over arrays."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from estimation.compiled import Floats, Helpers, State, sweep

LARGEST = 1e30
"""A sample at least this large is refused; the square of a sum of such would soon overflow."""


class Estimate(NamedTuple):
    """Damping `b` [N s/m] and stiffness `k` [N/m] after one sample."""

    b: float
    k: float


class Estimates(NamedTuple):
    """Damping `b` [N s/m] and stiffness `k` [N/m] after each sample, arrays of shape (n,)."""

    b: Floats
    k: Floats


class Estimator(ABC):
    """Online estimator of the Kelvin-Voigt environment f = b v + k x, the paper's (1).

    A subclass gives `step`, a pure function on scalars whose state begins with (b, k), the
    functions that it calls in `helpers`, and its `parameters`. `update` and `run` both apply
    this one step, so they give the same numbers to the bit.
    """

    helpers: ClassVar[Helpers] = ()

    @staticmethod
    @abstractmethod
    def step(parameters: State, state: State, v: float, x: float, f: float, dt: float) -> State:
        """State after one sample."""

    def __init__(self, parameters: State, initial_state: State) -> None:
        self.parameters = tuple(float(value) for value in parameters)
        self._initial_state = tuple(float(value) for value in initial_state)
        self.state = self._initial_state

    def reset(self) -> None:
        """Forget every sample."""
        self.state = self._initial_state

    @property
    def estimate(self) -> Estimate:
        """The present estimate."""
        return Estimate(self.state[0], self.state[1])

    @abstractmethod
    def note(self, estimates: Estimates) -> str | None:
        """What a reader of these estimates of its own must know of them, in one line."""

    def update(self, x: float, v: float, f: float, dt: float) -> Estimate:
        """Take in one sample.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N].
        dt
            Time since the sample before [s].

        Raises
        ------
        ValueError
                A value is not finite or absurdly large (`LARGEST`), or `dt` is not positive. The
            estimator stays as it was.
        """
        x, v, f, dt = float(x), float(v), float(f), float(dt)
        check_sample(dt, x=x, v=v, f=f)
        return self.advance(x, v, f, dt)

    def advance(self, x: float, v: float, f: float, dt: float) -> Estimate:
        """Take in one sample of floats that `check_sample` has passed."""
        self.state = state = type(self).step(self.parameters, self.state, v, x, f, dt)
        return Estimate(state[0], state[1])

    def run(self, x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike) -> Estimates:
        """Take in n samples as `update` would, one by one.

        Parameters
        ----------
        x, v, f
            Displacement [m], velocity [m/s], force [N], each of shape (n,).
        dt
            Time since the sample before [s], of shape (n,), or one number for all.

        Raises
        ------
        ValueError
            The shapes differ, a value is not finite, or a `dt` is not positive. The
            estimator stays as it was.
        """
        x, v, f, dt = checked_samples(x, v, f, dt)
        states = sweep(type(self).step, self.helpers, self.parameters, self.state, (v, x, f, dt))
        if len(states):
            self.state = tuple(states[-1].tolist())
        return Estimates(states[:, 0].copy(), states[:, 1].copy())


def check_sample(dt: float, **values: float) -> None:
    """Raise ValueError unless the values are finite and not absurdly large, and dt is positive."""
    if not (sum(map(abs, values.values())) < LARGEST and 0.0 < dt < math.inf):
        got = ", ".join(f"{name}={value!r}" for name, value in values.items())
        raise ValueError(
            f"a sample must be finite, below {LARGEST:g}, with dt > 0, got {got}, dt={dt!r}"
        )


def checked_samples(
    x: ArrayLike, v: ArrayLike, f: ArrayLike, dt: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """The four as contiguous float64 arrays of shape (n,).

    Raises
    ------
    ValueError
        The shapes differ, a value is not finite, or a `dt` is not positive.
    """
    shape = np.shape(x)
    if len(shape) != 1:
        raise ValueError(f"samples must be one-dimensional, x has shape {shape}")
    if np.ndim(dt) == 0:
        dt = np.full(shape, dt, dtype=np.float64)
    checked = []
    for name, channel in (("x", x), ("v", v), ("f", f), ("dt", dt)):
        array = np.ascontiguousarray(channel, dtype=np.float64)
        if array.shape != shape:
            raise ValueError(f"{name} has shape {array.shape}, but x has {shape}")
        good = (array > 0.0) & (array < np.inf) if name == "dt" else np.abs(array) < LARGEST
        if not good.all():
            n = int(np.argmin(good))
            expected = "a positive number" if name == "dt" else f"a finite number below {LARGEST:g}"
            raise ValueError(f"{name}[{n}] is {array[n]}, expected {expected}")
        checked.append(array)
    return checked[0], checked[1], checked[2], checked[3]


def positive_pair(name: str, pair: tuple[float, float]) -> tuple[float, float]:
    """A setting's values for (b, k), or ValueError unless both are positive and finite."""
    if len(pair) != 2 or not all(0.0 < value < math.inf for value in pair):
        raise ValueError(f"{name} must be two positive numbers, for b and for k, got {pair}")
    return pair
