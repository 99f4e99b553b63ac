"""Conversion of a device's time stamps to the controller's clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Largest drift between two crystal clocks [s/s]."""
WRAP = 1 << 32
MICROSECOND = 1e-6


class DeviceClock:
    """Conversion of a device's time stamps, 32-bit microseconds, to the controller's clock.

    All samples that are found when a port is read were taken before. So the time of a reading
    minus the newest time stamp in it is the offset between the clocks plus the age of the sample,
    which is positive. The same is true for the mean of two reading times minus the mean of their
    newest time stamps, also after a delay of the controller or of the device. The minimum of
    these differences, allowed to increase by the drift of two crystals, is the offset plus the
    smallest age (lower envelope).

    So a converted time is never too early. It is too late by the smallest age, which is the
    smallest latency, well below 1 ms on USB, plus at most one sample period. (The age of a sample
    that arrived just before the reading may therefore be negative, by up to half a period.)
    Delayed samples, for example from a queue, do not change the envelope; the delay is part of
    their age.

    If the clock of a device is slow by more than `DRIFT`, for example without a crystal, the
    converted times become later and later.
    """

    def __init__(self) -> None:
        self._newest: int | None = None
        self._offset = math.nan
        self._certain = False
        self._seen = math.nan

    def observe(self, newest: int, now: float) -> None:
        """Update the offset after a reading of the port.

        Parameters
        ----------
        newest
            Newest time stamp in the data [us].
        now
            Mean of the times of this reading and of the previous one [s].
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
        """Convert a time stamp [us] to the controller's clock [s]; NaN before `observe`."""
        return self._continued(stamp) * MICROSECOND + self._offset

    def _continued(self, stamp: int) -> int:
        """Return the time stamp without the wrap at 2^32, within 2^31 of the newest one."""
        if self._newest is None:
            return stamp
        ahead = (stamp - self._newest) % WRAP
        return self._newest + (ahead if ahead < WRAP // 2 else ahead - WRAP)
