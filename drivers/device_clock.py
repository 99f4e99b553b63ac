"""Conversion of a device's time stamps to the controller's clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Largest relative drift between the crystal clocks of the device and of this computer [s/s]."""
WRAP = 1 << 32
"""Number of different time stamps; after the last value, time stamps start at zero again."""
MICROSECOND = 1e-6


class DeviceClock:
    """Conversion of a device's time stamps, 32-bit microseconds, to the controller's clock.

    A sample is always taken before the port is read. The difference between the time of the
    reading and the newest time stamp in the data is therefore the offset between the two clocks
    plus the age of the newest sample. This age is positive. The same is true for the means of
    two successive readings, also after a delay of the controller or of the device: the mean of
    the times minus the mean of the newest time stamps. The minimum of these differences (lower
    envelope) is the offset plus the smallest age. From one reading to the next, the minimum may
    increase by the largest drift between two crystal clocks, `DRIFT`.

    A converted time is therefore never too early. It is too late by the smallest age, which is
    the smallest latency, well below 1 ms on USB, plus at most one sample period. The computed age
    of a sample that arrived just before the reading can therefore be negative, by up to half a
    sample period. A sample that was delayed, for example in a queue, does not change the minimum,
    because the delay makes its age larger.

    If the clock of a device is slow by more than `DRIFT`, for example because the device has no
    crystal, the error of the converted times increases steadily.
    """

    def __init__(self) -> None:
        self._newest: int | None = None
        self._offset = math.nan
        self._certain = False
        self._seen = math.nan

    def observe(self, newest: int, now: float) -> None:
        """Update the offset between the clocks after a reading of the port.

        Parameters
        ----------
        newest
            Newest time stamp in the data of this reading [us].
        now
            Mean of the times of this reading and of the previous reading [s].
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
        """Convert a time stamp of the device [us] to the controller's clock [s].

        The result is NaN before the first call of `observe`.
        """
        return self._continued(stamp) * MICROSECOND + self._offset

    def _continued(self, stamp: int) -> int:
        """Return a time stamp [us] that does not wrap at 2^32.

        The result differs from the newest time stamp by at most 2^31 us.
        """
        if self._newest is None:
            return stamp
        ahead = (stamp - self._newest) % WRAP
        return self._newest + (ahead if ahead < WRAP // 2 else ahead - WRAP)
