"""Alignment: position and force of one moment, from sensors that sample at moments of their own.

The estimators relate a force to the displacement at the same time; a millisecond between the
two is a damping error of k * 1 ms. So each force sample is paired with the position that is
interpolated for its moment, and a slow force sensor gives few pairs, not held ones.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from drivers import Measurement

SAME_TIME = 1e-6
"""Moments that are closer are one [s]."""
KEPT = 128
"""Positions that are kept to interpolate between, 0.1 s at 1 kHz."""


class Pair(NamedTuple):
    """A position and a force of the same moment."""

    position: float
    """[m]"""
    force: float
    """[N]"""
    dt: float
    """Since the pair before [s]."""


class Alignment:
    """Pairs the samples of slave position and contact force."""

    def __init__(self) -> None:
        self._positions: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._forces: deque[tuple[float, float]] = deque(maxlen=2)
        self._seen = self._paired = -math.inf

    def update(self, measurement: Measurement, dt: float) -> Pair | None:
        """The next pair, if the measurement, `dt` [s] after the last, completes one.

        A force sample that is newer than the position waits for the next position.
        """
        now, age = measurement.time, measurement.age
        positions, forces = self._positions, self._forces
        sampled = now - age.slave_position
        if not positions or sampled - positions[-1][0] > SAME_TIME:
            positions.append((sampled, measurement.slave_position))
        sampled = now - age.contact_force
        if sampled - self._seen > SAME_TIME:
            self._seen = sampled
            forces.append((sampled, measurement.contact_force))
        if not forces or forces[0][0] - positions[-1][0] > SAME_TIME:
            return None
        moment, force = forces.popleft()
        if self._paired > -math.inf:
            dt = moment - self._paired
        self._paired = moment
        return Pair(self._position_at(moment), force, dt)

    def _position_at(self, moment: float) -> float:
        """Position [m] at a moment that is not after the newest one."""
        after, later = self._positions[-1]
        for time, position in reversed(self._positions):
            if time <= moment + SAME_TIME:
                if moment - time <= SAME_TIME or after == time:
                    return position
                return position + (later - position) * (moment - time) / (after - time)
            after, later = time, position
        return later
