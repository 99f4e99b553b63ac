"""The controller's time of what a device stamped on its own clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Most that the two clocks run apart: two crystals [s/s]."""
WRAP = 1 << 32
MICROSECOND = 1e-6


class DeviceClock:
    """Maps a device's time stamps, microseconds in 32 bits, to the controller's clock.

    What a drain finds was taken before it. So the time of a drain less the newest stamp that it
    found is the offset between the clocks plus an age, which is positive; and so is the mean of
    two drains less the mean of their newest stamps. That holds however long the controller or the
    device was held up in between. The least of all such differences, allowed to rise by
    the drift of two crystals, is the offset plus the least age (the lower envelope).

    So a time is never too early, and too late by the least age: the least latency, well below a
    millisecond on USB, and no more than the time between two samples, less where drains and
    samples pass each other. (A sample that came just before its drain may so seem to be half of
    that time younger than nothing.) What is delivered late, or out of a queue that builds up, does
    not move the envelope and shows in the sample's age.

    A device whose clock is slower by more than `DRIFT`, as without a crystal, seems ever later.
    """

    def __init__(self) -> None:
        self._newest: int | None = None
        self._offset = math.nan
        self._certain = False
        self._seen = math.nan

    def observe(self, newest: int, now: float) -> None:
        """Take in what a drain found.

        Parameters
        ----------
        newest
            The newest of the time stamps [us].
        now
            The middle between this drain and the one before [s].
        """
        stamp = self._continued(newest)
        before = stamp if self._newest is None else self._newest
        offset = now - 0.5 * (before + stamp) * MICROSECOND
        if self._certain:
            offset = min(offset, self._offset + DRIFT * (now - self._seen))
        self._certain = self._newest is not None
        self._newest = stamp
        self._offset = offset
        self._seen = now

    def time(self, stamp: int) -> float:
        """When a sample was taken [s], on the controller's clock; NaN before any was observed."""
        return self._continued(stamp) * MICROSECOND + self._offset

    def _continued(self, stamp: int) -> int:
        """The stamp as if the counter were endless, within half a turn of the newest."""
        if self._newest is None:
            return stamp
        ahead = (stamp - self._newest) % WRAP
        return self._newest + (ahead if ahead < WRAP // 2 else ahead - WRAP)
