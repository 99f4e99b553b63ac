"""The loop's clock: real, paced on absolute deadlines, or virtual, as fast as it goes."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from typing import NamedTuple

SPIN = 200_000
"""The last stretch before a deadline is spent polling the clock, not sleeping [ns]."""


class Tick(NamedTuple):
    """The start of one period of the loop."""

    lateness: float
    """How long after its deadline the tick began [s]."""
    overrun: bool
    """Whether the tick before was still at work at this deadline."""
    skipped: int
    """Whole periods that it therefore left out."""
    busy: float = 0.0
    """How long the tick before was at work, from its start to the wait after it [s]."""


class Clock(ABC):
    """A clock that wakes the loop once a period.

    Parameters
    ----------
    rate
        Ticks a second [Hz].

    Raises
    ------
    ValueError
        The rate is not positive.
    """

    def __init__(self, rate: float) -> None:
        if not 0.0 < rate < math.inf:
            raise ValueError(f"rate must be positive, got {rate} Hz")
        self.rate = rate
        self.period = 1.0 / rate

    @abstractmethod
    def now(self) -> float:
        """Time [s] since the clock was made."""

    @abstractmethod
    def stopwatch(self) -> float:
        """Time [s] by which the parts of a tick are timed."""

    @abstractmethod
    def wait(self) -> Tick:
        """Return at the next deadline; the first call sets the first deadline to now."""


class VirtualClock(Clock):
    """Time that passes only from tick to tick; the same on every machine and in every run."""

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self._tick = -1

    def now(self) -> float:
        """Time [s] since the clock was made."""
        return max(self._tick, 0) / self.rate

    stopwatch = now

    def wait(self) -> Tick:
        """Move on to the next deadline."""
        self._tick += 1
        return Tick(0.0, False, 0)


class RealClock(Clock):
    """The machine's monotonic clock, with deadlines at whole periods from the first tick.

    Deadlines are never re-anchored to the present, so lateness does not add up. A tick that
    is late by whole periods leaves these out and keeps to the same deadlines.
    """

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self._origin = time.monotonic_ns()
        self._first = self._woken = 0
        self._tick = -1

    def now(self) -> float:
        """Time [s] since the clock was made."""
        return (time.monotonic_ns() - self._origin) * 1e-9

    def stopwatch(self) -> float:
        """The finest clock that there is [s]."""
        return time.perf_counter()

    def _deadline(self, tick: int) -> int:
        return self._first + round(tick * 1e9 / self.rate)

    def wait(self) -> Tick:
        """Sleep until the next deadline, the last `SPIN` of it awake."""
        now = time.monotonic_ns()
        if self._tick < 0:
            self._first = self._woken = now
        due = self._deadline(self._tick + 1)
        skipped = max(0, int((now - due) * 1e-9 * self.rate))
        self._tick += 1 + skipped
        deadline = self._deadline(self._tick)
        if deadline - now > SPIN:
            time.sleep((deadline - now - SPIN) * 1e-9)
        busy = now - self._woken
        while (woken := time.monotonic_ns()) < deadline:
            pass
        self._woken = woken
        return Tick((woken - deadline) * 1e-9, now > due, skipped, busy * 1e-9)
