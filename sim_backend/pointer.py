"""An operator whose hand follows a pointer, such as the mouse in the live page.

The pointer gives the wanted position of the hand, and whether the hand holds the handle. The wanted
position changes in steps. From the wanted position, a critically damped filter of second order
computes a smooth intended motion. The impedance of the arm then gives the force on the handle, as
for the other operators.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim_backend.hand import Hand
from sim_backend.plant import Intention

BANDWIDTH = 10.0
"""Natural frequency of the filter [Hz]."""
Pointer = Callable[[], tuple[float, bool]]
"""Function that returns the wanted position of the hand [m], and whether the hand holds the
handle."""


class PointerOperator(Hand):
    """Intended motion of a hand that follows a pointer.

    When the hand grips the handle, the intended motion begins at the position and with the velocity
    of the handle, so that the force begins at zero.

    Parameters
    ----------
    pointer
        The pointer, which is read once per tick while the drives are in operation.

    Attributes
    ----------
    time
        Time at which the pointer was last read [s]. The time is zero when the drives are enabled.
        Before the first reading, the value is NaN.
    depth
        Position of the pointer at `time` [m].
    grip
        Whether the hand held the handle at `time`.
    """

    def __init__(self, pointer: Pointer) -> None:
        self.time = self.depth = math.nan
        self.grip = False
        self._pointer = pointer
        self._position = self._velocity = 0.0

    def intention(self, t: float) -> Intention | None:
        """Return the filtered motion of the pointer; None if the hand does not hold the handle."""
        held, last = self.grip, self.time
        self.time = t
        self.depth, self.grip = self._pointer()
        if not self.grip:
            return None
        if not held:
            handle = self.handle
            self._position, self._velocity = (handle.x, handle.v) if handle else (0.0, 0.0)
        else:
            self._follow(self.depth, t - last)
        return Intention(self._position, self._velocity)

    def _follow(self, target: float, dt: float) -> None:
        """Advance the filter by dt [s] with a constant target u [m]; the solution is exact.

        y is the intended position, e = y - u the error, and w the natural angular frequency. The
        filter has the equation e'' + 2 w e' + w^2 e = 0.
        """
        omega = 2.0 * math.pi * BANDWIDTH
        error, rate = self._position - target, self._velocity
        slope = rate + omega * error
        decay = math.exp(-omega * dt)
        self._position = target + (error + slope * dt) * decay
        self._velocity = (rate - omega * slope * dt) * decay
