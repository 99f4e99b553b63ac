"""An operator whose hand follows a pointer, such as the mouse in the live page.

The pointer gives the wanted position of the hand, and whether the hand holds the handle. The wanted
position changes in steps. Its speed is limited, whatever the pointer sends. From the limited
position, a critically damped filter of second order computes a smooth intended motion. The
impedance of the arm then gives the force on the handle, as for the other operators.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim_backend.operators import Hand
from sim_backend.plant import Intention

BANDWIDTH = 10.0
"""Natural frequency of the filter [Hz]."""
MOST_SPEED = 0.2
"""Largest speed of the wanted position while the hand holds the handle [m/s]. A person who palpates
moves the hand more slowly: the fastest target of the condition `mimic` moves at 0.05 m/s. A jump of
the pointer, which no hand can make, therefore causes no sudden force."""
Pointer = Callable[[], tuple[float, bool]]
"""Function that returns two values: the wanted position of the hand [m], and whether the hand holds
the handle."""


class PointerOperator(Hand):
    """Operator whose hand follows a pointer, such as a mouse.

    When the hand grips the handle, the wanted position and the intended motion begin at the
    position of the handle, and the intended motion has the velocity of the handle, so that the
    force begins at zero.

    Attributes
    ----------
    time
        Time at which the pointer was last read, since the drives were enabled [s]. Before the
        first reading, the value is NaN.
    depth
        Wanted position of the hand at `time` [m]. This is the position of the pointer, or, if the
        pointer is faster than `MOST_SPEED`, the position that it can reach with this speed.
    grip
        Whether the hand held the handle at `time`.
    """

    def __init__(self, pointer: Pointer) -> None:
        self.time = self.depth = math.nan
        self.grip = False
        self._pointer = pointer
        self._position = self._velocity = 0.0

    def intention(self, t: float) -> Intention | None:
        """Return the intended motion at t [s] after the drives were enabled.

        The intended motion is the filtered motion of the pointer. The result is None if the hand
        does not hold the handle.
        """
        held, last, before = self.grip, self.time, self.depth
        self.time = t
        self.depth, self.grip = self._pointer()
        if not self.grip:
            return None
        if not held or t < last:
            handle = self.handle
            self._position, self._velocity = (handle.x, handle.v) if handle else (0.0, 0.0)
            self.depth = self._position
        else:
            reach = MOST_SPEED * (t - last)
            self.depth = min(max(self.depth, before - reach), before + reach)
            self._follow(self.depth, t - last)
        return Intention(self._position, self._velocity)

    def _follow(self, target: float, dt: float) -> None:
        """Advance the filter by the time `dt` [s], in which the wanted position is constant.

        `target` is the wanted position [m]. The error e is the intended position minus `target`,
        and w is the natural angular frequency of the filter. The equation of the filter,
        e'' + 2 w e' + w^2 e = 0, is solved exactly.
        """
        omega = 2.0 * math.pi * BANDWIDTH
        error, rate = self._position - target, self._velocity
        slope = rate + omega * error
        decay = math.exp(-omega * dt)
        self._position = target + (error + slope * dt) * decay
        self._velocity = (rate - omega * slope * dt) * decay
