"""Pair the force samples with the positions of the slave at the times of these samples.

The estimators need force and displacement at the same time. A time difference of 1 ms between force
and displacement causes a damping error of k * 1 ms, where k is the stiffness. Therefore the
position is interpolated at the time of each force sample. If the force sensor is slower than the
loop, there are fewer pairs than ticks. Each force sample is used in at most one pair.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from drivers import Measurement, new_tuple

SAME_TIME = 1e-6
"""Largest difference between two times that are treated as equal [s]."""
KEPT = 128
"""Number of positions that are stored for interpolation; at 1 kHz, they cover 0.13 s."""


class Pair(NamedTuple):
    """A position and a force at the same time."""

    position: float
    """Position of the slave [m]."""
    force: float
    """Contact force [N]."""
    dt: float
    """Time since the previous pair [s]."""


class Alignment:
    """Computes pairs of slave position and contact force that belong to the same time."""

    def __init__(self) -> None:
        self._positions: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._forces: deque[tuple[float, float]] = deque(maxlen=2)
        self._seen = self._paired = -math.inf

    def update(self, measurement: Measurement, dt: float) -> Pair | None:
        """Store position and force of a measurement, and return the next pair.

        A force sample that is newer than the newest position sample is paired after the next
        position sample, because the position can only be interpolated between two samples.

        Parameters
        ----------
        measurement
            Measurement of this tick.
        dt
            Time since the previous tick [s]. For the first pair, `Pair.dt` is this time, because
            there is no previous pair.

        Returns
        -------
        pair
            The next pair; None if no force sample can be paired yet.
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
        sampled, force = forces.popleft()
        if self._paired > -math.inf:
            dt = sampled - self._paired
        self._paired = sampled
        return new_tuple(Pair, (self._position_at(sampled), force, dt))

    def _position_at(self, sampled: float) -> float:
        """Return the position [m] at the time `sampled` [s], interpolated between two samples.

        The time is not after the newest position sample.
        """
        after, later = self._positions[-1]
        if after <= sampled + SAME_TIME:
            return later
        for time, position in reversed(self._positions):
            if time <= sampled + SAME_TIME:
                if sampled - time <= SAME_TIME:
                    return position
                return position + (later - position) * (sampled - time) / (after - time)
            after, later = time, position
        return later
