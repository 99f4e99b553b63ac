"""Disturbance observer of the force of the hand, for a master without a force sensor."""

from __future__ import annotations

import math
from collections import deque

from drivers import Measurement

BANDWIDTH = 30.0
"""Bandwidth of the observer [Hz]. The force of a hand changes with a few hertz."""


class HandObserver:
    """Estimates the force of the hand on a force-commanded handle from its motion.

    The handle has the mass m and the viscous damping b, and the motor acts with the force -F_c of
    the virtual coupling, some periods late:

        m v' = f_hand - F_c - b v

    The estimate is the right side without the hand, low-pass filtered: LPF(m v' + b v + F_c)
    (Murakami, Yu, Ohnishi, IEEE Trans. Industrial Electronics 40(2), 1993). Errors of m and b, and
    friction of another kind, are errors of the estimate. It is recorded, and not used in the loop.

    Parameters
    ----------
    mass
        Moving mass of the handle [kg].
    friction
        Viscous damping of the handle [N s/m].
    latency
        Whole periods from a measurement to the force that is computed from it.
    """

    def __init__(self, mass: float, friction: float, latency: int) -> None:
        self._mass, self._friction = mass, friction
        self._rate = 2.0 * math.pi * BANDWIDTH
        self._forces: deque[float] = deque(maxlen=latency + 1)
        self._time = self._position = self._velocity = math.nan
        self.force = math.nan
        """Latest estimate [N], positive as the force of the coupling; NaN before the first one."""

    @property
    def text(self) -> str:
        """Parameters of the observer."""
        return (
            f"mass {self._mass:g} kg, friction {self._friction:g} N s/m, bandwidth "
            f"{BANDWIDTH:g} Hz; not used by the controller"
        )

    def update(self, measurement: Measurement) -> float:
        """Process the measurement of one tick; return the estimate [N]."""
        time = measurement.time - measurement.age.master_position
        dt = time - self._time
        if dt <= 0.0:  # no new sample
            return self.force
        position = measurement.master_position
        velocity = (position - self._position) / dt
        # The force that acted in this interval was computed `latency` samples before its start.
        acting = self._forces[0] if self._forces else 0.0
        forced = acting + self._friction * velocity
        inertial = self._mass * (velocity - self._velocity) / dt
        self._forces.append(measurement.master_force)
        self._time, self._position, self._velocity = time, position, velocity
        found = forced + inertial
        if math.isfinite(found):
            last = self.force if math.isfinite(self.force) else found
            self.force = last - math.expm1(-self._rate * dt) * (found - last)
        return self.force
