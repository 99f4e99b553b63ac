"""Contact gate. The estimates change only while there is contact and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Law, Samples, sweep
from estimation.step import Regressors, State


class GateSettings(NamedTuple):
    """Settings of a contact gate. The gate is open above the thresholds of force and speed."""

    force: float
    """There is contact while the root mean square of the force is above this value [N]."""
    speed: float
    """There is motion while the root mean square of the velocity is above this value [m/s]."""
    window: float
    """Time constant [s] of the mean squares of force and velocity."""


@dataclass(frozen=True, slots=True)
class GateParameters:
    """Constant settings of the function `step`."""

    window: float
    """Time constant of the mean squares [s]."""
    v_square: float
    """There is motion while the mean square of the velocity is above this value [m^2/s^2]."""
    f_square: float
    """There is contact while the mean square of the force is above this value [N^2]."""


@dataclass(slots=True)
class GateState(State):
    """Variables that `step` updates.

    The vector `theta` has only one element here, the mean square of the force [N^2]. `held` is True
    while the gate is closed.
    """

    v_square: float
    """Mean square of the velocity [m^2/s^2]."""


def step(
    parameters: GateParameters, state: GateState, phi: Regressors, f: float, dt: float
) -> None:
    """Update the mean squares of velocity and force, and set `held` if one of them is too small.

    `held` is also set if the force of the present sample is below the threshold. So the gate closes
    at the first sample out of contact, before the mean square has decayed.
    """
    v, theta = phi[0], state.theta
    share = dt / (parameters.window + dt)
    square = f * f
    state.v_square += share * (v * v - state.v_square)
    theta[0] += share * (square - theta[0])
    contact = min(theta[0], square)
    state.held = not (state.v_square > parameters.v_square and contact > parameters.f_square)


class Gate:
    """Gate that is open only during contact and motion; estimates do not change while it is closed.

    Out of contact the force is zero for every motion, and an estimator would converge to zero
    stiffness. At rest the velocity is encoder noise, and an estimator would fit damping to it.

    Parameters
    ----------
    settings
        Thresholds of force and speed, and the time constant of the mean squares.

    Raises
    ------
    ValueError
        A setting is negative or not finite, or the time constant `window` is not positive.

    Attributes
    ----------
    contacts
        Whether there was contact at each sample of the last `run`, shape (n,).
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
        self.contacts = np.zeros(0, dtype=np.bool_)
        self.reset()

    def reset(self) -> None:
        """Discard all samples."""
        self._state = GateState([0.0], [math.nan], True, 0.0)

    def update(self, phi: Regressors, f: float, dt: float) -> bool:
        """Process a sample phi = [v, x, ...], f [N], dt [s]; return whether the gate is open."""
        step(self._law.parameters, self._state, phi, f, dt)
        return not self._state.held

    @property
    def is_open(self) -> bool:
        """Whether the gate is open."""
        return not self._state.held

    @property
    def contact(self) -> bool:
        """Whether the root mean square of the force is above its threshold."""
        return bool(self._state.theta[0] > self._law.parameters.f_square)

    def run(self, samples: Samples) -> NDArray[np.bool_]:
        """Process n samples; return whether the gate is open at each sample, shape (n,)."""
        table = sweep(self._law, self._state, samples)
        self.contacts = np.asarray(table[:, 0] > self._law.parameters.f_square)
        return np.asarray(table[:, 2] == 0.0)
