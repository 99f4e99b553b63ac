"""Define the contact gate.

The contact gate stops the update of the estimators while there is no contact or no motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import Law, Samples, sweep
from estimation.step import Regressors, State


class GateSettings(NamedTuple):
    """Settings of a contact gate: the thresholds above which there is contact and motion."""

    force: float
    """There is contact while the root mean square of the force is above this value [N]."""
    speed: float
    """There is motion while the root mean square of the velocity is above this value [m/s]."""
    window: float
    """Time constant [s] of the mean squares of force and velocity."""


@dataclass(frozen=True, slots=True)
class GateParameters:
    """Constant settings of `step`, the function with which the contact gate processes a sample."""

    window: float
    """Time constant of the mean squares [s]."""
    v_square: float
    """There is motion while the mean square of the velocity is above this value [m^2/s^2]."""
    f_square: float
    """There is contact while the mean square of the force is above this value [N^2]."""


@dataclass(slots=True)
class GateState(State):
    """Variables that `step` updates, the function with which the contact gate processes a sample.

    The fields of the base class have another meaning here. `theta` contains one number, the mean
    square of the force [N^2]. `std` is not used. `held` is True while the gate is closed.
    """

    v_square: float
    """Mean square of the velocity [m^2/s^2]."""


def step(
    parameters: GateParameters, state: GateState, phi: Regressors, f: float, dt: float
) -> None:
    """Update the mean squares of velocity and force, and open or close the gate.

    The gate is open (`state.held` = False) while three values are above their thresholds: the mean
    square of the velocity, the mean square of the force, and the square of the present force. The
    third value closes the gate at the first sample without contact, when the mean square of the
    force has not decayed yet.
    """
    v, theta = phi[0], state.theta
    share = dt / (parameters.window + dt)
    square = f * f
    state.v_square += share * (v * v - state.v_square)
    theta[0] += share * (square - theta[0])
    contact = min(theta[0], square)
    state.held = not (state.v_square > parameters.v_square and contact > parameters.f_square)


class Gate:
    """Contact gate, which is open only during contact and motion.

    While the gate is closed, the estimates do not change. Without contact the force is zero, so
    that an estimator would converge to zero stiffness. Without motion the measured velocity is
    only encoder noise, so that an estimator would compute a wrong damping from this noise.

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
        Whether the root mean square of the force was above its threshold, for each of the n
        samples of the last call of `run`, shape (n,).
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
        """Discard all samples, and close the gate."""
        self._state = GateState([0.0], [math.nan], True, 0.0)

    def update(self, phi: Regressors, f: float, dt: float) -> bool:
        """Process one sample, and return whether the gate is open.

        `phi` contains the regressors [v, x, ...], `f` is the force [N], and `dt` is the time since
        the previous sample [s].
        """
        step(self._law.parameters, self._state, phi, f, dt)
        return not self._state.held

    @property
    def is_open(self) -> bool:
        """Whether the gate is open after the latest sample."""
        return not self._state.held

    @property
    def contact(self) -> bool:
        """Whether the root mean square of the force is above the threshold `settings.force`."""
        return bool(self._state.theta[0] > self._law.parameters.f_square)

    def run(self, samples: Samples) -> NDArray[np.bool_]:
        """Process n samples; return whether the gate is open after each sample, shape (n,)."""
        table = sweep(self._law, self._state, samples)
        self.contacts = np.asarray(table[:, 0] > self._law.parameters.f_square)
        return np.asarray(table[:, 2] == 0.0)
