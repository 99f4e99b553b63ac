"""The controller's time of what a device stamped on its own clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Most that the two clocks run apart: two crystals [s/s]."""
WRAP = 1 << 32
MICROSECOND = 1e-6


class DeviceClock:
    """Maps a device's time stamps, microseconds in 32 bits, to the controller's clock.

    A sample cannot arrive before it was taken: arrival minus stamp is the offset between the clocks
    plus a latency. So the least difference of all, allowed to rise by the drift of two crystals, is
    the offset plus the least latency (the lower envelope). A delivery that is late does not
    move it, and so shows in the sample's age; nor does a queue that builds up slowly.

    When a frame arrived is known to half of the time between two drains. So a sample's time is
    true to half of the longer of that and the time between two samples, either way; and too late
    by the least latency (well below a millisecond on USB). At a kilohertz that is half a
    millisecond, and mostly to the old side, as the least of many differences is taken.

    A device whose clock is slower by more than `DRIFT`, as without a crystal, seems ever later.
    """

    def __init__(self) -> None:
        self._unwrapped = 0
        self._offset = math.nan
        self._seen = math.nan

    def observe(self, first: int, last: int, now: float) -> None:
        """Take in that samples were found.

        The middle of their stamps is held against the middle of the time in which they came. So it
        does not matter how long the controller did not look: after a stall both middles are as far
        back.

        Parameters
        ----------
        first, last
            Time stamps of the first and last of them [us].
        now
            The middle of the time in which they arrived [s].
        """
        middle = 0.5 * (self._seconds(first) + self._seconds(last))
        offset = now - middle
        if not math.isnan(self._offset):
            offset = min(offset, self._offset + DRIFT * max(now - self._seen, 0.0))
        self._offset = offset
        self._seen = now
        self._unwrapped = self._continued(last)

    def time(self, stamp: int) -> float:
        """When a sample was taken [s], on the controller's clock; NaN before any was observed."""
        return self._seconds(stamp) + self._offset

    def _seconds(self, stamp: int) -> float:
        return self._continued(stamp) * MICROSECOND

    def _continued(self, stamp: int) -> int:
        """The stamp as if the counter were endless, within half a turn of the last."""
        ahead = (stamp - self._unwrapped) % WRAP
        return self._unwrapped + (ahead if ahead < WRAP // 2 else ahead - WRAP)
