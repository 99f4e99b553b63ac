"""Convert the time stamps of a device to the controller's clock."""

from __future__ import annotations

import math

DRIFT = 100e-6
"""Largest relative drift between the crystal clocks of the device and of this computer [s/s]."""
WRAP = 1 << 32
"""Number of different time stamps. After the largest value, time stamps start at zero again."""
MICROSECOND = 1e-6


class DeviceClock:
    """Converts the time stamps of a device to the controller's clock.

    A sample of the device has a time stamp: the time on the device's clock, as a 32-bit number of
    microseconds. A time stamp is converted by adding an offset, which is the time on the
    controller's clock minus the time on the device's clock. This class estimates the offset.

    The serial port is read periodically. Consider two successive readings at the times t1 and t2,
    and the newest time stamps s1 and s2 received until then. The difference t2 - s2 is the true
    offset plus the age of the newest sample at t2. The age is positive. The port does not give t2,
    but the mean of t1 and t2. Therefore this class computes the difference

        d = (t1 + t2) / 2 - (s1 + s2) / 2,

    which is the true offset plus the mean of two ages. The estimated offset is the smallest d of
    all readings. Since the clocks drift, the estimate may also increase: at most by `DRIFT` [s/s].

    The estimated offset is larger than the true offset by the smallest mean age. Therefore a
    converted time is never too early, and is too late by this mean age. The error is at most one
    sample period plus the smallest latency, which is well below 1 ms on USB. A delayed sample, for
    example a sample that waited in a queue, has a larger age, and so does not change the estimate.
    If a sample arrives just before a reading, its true age can be smaller than the error, by up to
    half a sample period. The age that is computed from the converted time is then negative.

    A device without a crystal oscillator can have a clock that is slow by more than `DRIFT`. The
    error of the converted times then increases steadily.
    """

    def __init__(self) -> None:
        self._newest: int | None = None
        self._offset = math.nan
        self._certain = False
        self._seen = math.nan

    def observe(self, newest: int, now: float) -> float:
        """Update the estimated offset between the two clocks, after the serial port was read.

        Parameters
        ----------
        newest
            Newest time stamp of the device in the received data [us].
        now
            Mean of two times on the controller's clock [s]: when the port was read now, and when
            the port was read the previous time.

        Returns
        -------
        float
            Newest time stamp on the controller's clock [s].
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
        return stamp * MICROSECOND + offset

    def time(self, stamp: int) -> float:
        """Convert a time stamp of the device [us] to the controller's clock [s].

        The result is NaN before the first call of `observe`.
        """
        return self._continued(stamp) * MICROSECOND + self._offset

    def _continued(self, stamp: int) -> int:
        """Return a time stamp [us] plus the multiple of 2^32 us that corrects its overflow.

        After 2^32 us, the time stamps of the device start at zero again. The result is the value
        that is nearest to the newest time stamp that was passed to `observe`.
        """
        if self._newest is None:
            return stamp
        ahead = (stamp - self._newest) % WRAP
        return self._newest + (ahead if ahead < WRAP // 2 else ahead - WRAP)
