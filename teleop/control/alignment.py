"""Combine each sample of the contact force with the position of the slave at the same time.

The estimators need force and position at the same time. If the force is 1 ms older or newer than
the position, the estimated damping has an error of k * 1 ms, where k is the stiffness. Therefore
the position is interpolated at the time of each force sample. The result is a pair of position and
force. If the force sensor is slower than the control loop, there are fewer pairs than ticks. Each
force sample is used in at most one pair.
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
    """Position of the slave and contact force at the same time."""

    position: float
    """Position of the slave [m]."""
    force: float
    """Contact force [N]."""
    dt: float
    """Time since the previous pair [s]."""


class Alignment:
    """Computes pairs of slave position and contact force at the same time.

    The two sensors can take their samples at different times. Therefore the position is
    interpolated at the time of each force sample.
    """

    def __init__(self) -> None:
        self._positions: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._forces: deque[tuple[float, float]] = deque(maxlen=2)
        self._seen = self._paired = -math.inf

    def update(self, measurement: Measurement, dt: float) -> Pair | None:
        """Store position and force of a measurement, and return a pair if one is complete.

        A force sample that is newer than the newest position sample is not used before the next
        position sample, because the position can only be interpolated between two samples.

        The `dt` of the first pair is that of the tick, because there is no previous pair.
        """
        now, age = measurement.time, measurement.age
        positions, forces = self._positions, self._forces
        sampled = now - age.slave_position
        if not positions or sampled - positions[-1][0] > SAME_TIME:
            positions.append((sampled, measurement.slave_position))
        sampled, force = now - age.contact_force, measurement.contact_force
        # a rig without a slave has no contact force: it is NaN
        if sampled - self._seen > SAME_TIME and force == force:
            self._seen = sampled
            forces.append((sampled, force))
        if not forces or forces[0][0] - positions[-1][0] > SAME_TIME:
            return None
        sampled, force = forces.popleft()
        if self._paired > -math.inf:
            dt = sampled - self._paired
        self._paired = sampled
        return new_tuple(Pair, (self._position_at(sampled), force, dt))

    def _position_at(self, sampled: float) -> float:
        """Return the position of the slave [m] at the time of a force sample.

        The position is interpolated between two stored position samples. If the force sample is
        older than all of them, the oldest stored position is returned.
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
