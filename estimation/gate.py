"""The gate: whether a sample has anything to say of the environment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Law, Parameters, Regressors, Samples, State, sweep


class GateSettings(NamedTuple):
    """When samples are taken in."""

    force: float
    """Contact: root mean square force [N] from which on there is one."""
    speed: float
    """Excitation: root mean square velocity [m/s] from which on the motion tells something."""
    window: float
    """Memory [s] of both."""


def step(parameters: Parameters, state: State, phi: Regressors, f: float, dt: float) -> None:
    """Mean squares of velocity and force, and whether either is too small.

    Contact ends with the sample that has no force, not once the mean has forgotten it.
    """
    share = dt / (parameters[0] + dt)
    square = f * f
    state[0] += share * (phi[0] * phi[0] - state[0])
    state[1] += share * (square - state[1])
    contact = min(state[1], square)
    state[2] = 0.0 if state[0] > parameters[1] and contact > parameters[2] else 1.0


class Gate:
    """Shut where there is no contact or no motion, so that estimates hold instead of drifting.

    Out of contact the force is nil whatever the motion, and an estimator would learn that there
    is no tissue; at rest, velocity is the encoder's noise, and it would learn damping from that.

    Parameters
    ----------
    settings
        Force and speed from which on it is open.

    Raises
    ------
    ValueError
        A setting is negative or not finite, or the window is not positive.
    """

    def __init__(self, settings: GateSettings) -> None:
        force, speed, window = settings
        if not (0.0 <= force < math.inf and 0.0 <= speed < math.inf and 0.0 < window < math.inf):
            raise ValueError(
                "a gate needs a force and a speed >= 0 and a positive window, got "
                f"{force} N, {speed} m/s, {window} s"
            )
        self.settings = settings
        self._law = Law(step, (), [window, speed * speed, force * force], 3)
        self.reset()

    def reset(self) -> None:
        """Forget every sample."""
        self._state = [0.0, 0.0, 1.0]

    def update(self, phi: Regressors, f: float, dt: float) -> bool:
        """Whether it is open for this sample of phi = [v, x, ...], force [N] and period [s]."""
        step(self._law.parameters, self._state, phi, f, dt)
        return self._state[2] == 0.0

    def run(self, samples: Samples) -> NDArray[np.bool_]:
        """Whether it is open for each of n samples, shape (n,)."""
        answers = sweep(self._law, self._state, samples)
        return np.asarray(answers[:, 2] == 0.0)
