"""The gate: whether a sample has anything to say of the environment."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Law, Samples, sweep
from estimation.step import Regressors, State


class GateSettings(NamedTuple):
    """When samples are taken in."""

    force: float
    """Contact: root mean square force [N] from which on there is one."""
    speed: float
    """Excitation: root mean square velocity [m/s] from which on the motion tells something."""
    window: float
    """Memory [s] of both."""


@dataclass(frozen=True, slots=True)
class GateParameters:
    """Parameters of `step`."""

    window: float
    """Memory of the mean squares [s]."""
    v_square: float
    """Mean square of the velocity above which there is motion [m^2/s^2]."""
    f_square: float
    """Mean square of the force above which there is contact [N^2]."""


@dataclass(slots=True)
class GateState(State):
    """State of `step`: an estimate of no parameters, which is held while the gate is shut."""

    v_square: float
    """Mean square of the velocity [m^2/s^2]."""
    f_square: float
    """Mean square of the force [N^2]."""


def step(
    parameters: GateParameters, state: GateState, phi: Regressors, f: float, dt: float
) -> None:
    """Mean squares of velocity and force, and whether either is too small.

    Contact ends with the first sample without force, not once the mean has decayed.
    """
    v = phi[0]
    share = dt / (parameters.window + dt)
    square = f * f
    state.v_square += share * (v * v - state.v_square)
    state.f_square += share * (square - state.f_square)
    contact = min(state.f_square, square)
    state.held = not (state.v_square > parameters.v_square and contact > parameters.f_square)


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
        self._law = Law(step, GateParameters(window, speed * speed, force * force))
        self.reset()

    def reset(self) -> None:
        """Forget every sample."""
        self._state = GateState([], [], True, 0.0, 0.0)

    def update(self, phi: Regressors, f: float, dt: float) -> bool:
        """Whether it is open for this sample of phi = [v, x, ...], force [N] and period [s]."""
        step(self._law.parameters, self._state, phi, f, dt)
        return not self._state.held

    def run(self, samples: Samples) -> NDArray[np.bool_]:
        """Whether it is open for each of n samples, shape (n,)."""
        answers = sweep(self._law, self._state, samples)
        return np.asarray(answers[:, 0] == 0.0)
