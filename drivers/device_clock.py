"""Convert the time stamps of a device to the controller's clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Largest relative drift between the crystal clocks of the device and of this computer [s/s]."""
WRAP = 1 << 32
"""Number of different time stamps. After the largest value, time stamps start at zero again."""
MICROSECOND = 1e-6


class DeviceClock:
    """Converts the time stamps of a device (32-bit microseconds) to the controller's clock.

    This class estimates the offset between the two clocks. At each reading of the port, it
    computes a difference: the time of the reading minus the newest time stamp in the data. Each
    sample is taken before the port is read. Therefore this difference is the offset plus the age of
    the newest sample, and the age is positive.

    Instead of the time of a reading, a port gives the mean of the times of this reading and of the
    previous reading. Therefore this class also computes the mean of the newest time stamps of
    these two readings. The difference of the two means is the offset plus a mean of two ages, which
    is positive. This is also true if the controller or the device is delayed.

    The estimated offset is the minimum of the differences of all readings. This minimum is the true
    offset plus the smallest mean age. From one reading to the next, the minimum may increase by the
    largest drift between two crystal clocks, `DRIFT`.

    A converted time is therefore never too early. It is too late by the smallest mean age, which is
    at most the smallest latency plus one sample period. On USB, the smallest latency is well below
    1 ms. The true age of a sample that arrives just before a reading can be smaller than the
    smallest mean age, by up to half a sample period. The computed age of this sample is then
    negative. A delayed sample, for example a sample that waited in a queue, has a larger age, and
    does not change the minimum.

    If the clock of a device has no crystal, it can be slow by more than `DRIFT`. In this case, the
    error of the converted times increases steadily.
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
        """Return a time stamp [us] that continues to increase after the overflow at 2^32.

        The difference between the result and the newest time stamp is at most 2^31 us.
        """
        if self._newest is None:
            return stamp
        ahead = (stamp - self._newest) % WRAP
        return self._newest + (ahead if ahead < WRAP // 2 else ahead - WRAP)
