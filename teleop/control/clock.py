"""Clocks, which determine when each tick of the control loop starts, in real or virtual time."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from typing import NamedTuple

SPIN = 200_000
"""Longest time before each deadline during which the loop polls the clock instead of sleeping
[ns]."""
LARGEST_SPIN = 0.4
"""Largest part of a period during which the loop polls the clock.

A loop that never sleeps would use its processor completely. Linux then stops a process with a
real-time priority for 50 ms in each second (`sched_rt_runtime_us`).
"""


class Tick(NamedTuple):
    """How late one tick of the control loop started, and how long the previous tick took."""

    lateness: float
    """Delay of the start of the tick after its deadline [s]."""
    overrun: bool
    """Whether the previous tick was still running at the deadline of this tick."""
    skipped: int
    """Number of whole periods that were skipped because the previous tick took too long."""
    busy: float = 0.0
    """Duration of the previous tick, from its start until the loop began to wait for this tick
    [s]."""


ON_TIME = Tick(0.0, False, 0)
"""Timing of each tick in virtual time, in which no tick is late."""


class Clock(ABC):
    """Base class of clocks. A clock starts one tick of the control loop per period.

    Parameters
    ----------
    rate
        Ticks per second [Hz].

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
        """Return the time since the clock was created [s]."""

    @abstractmethod
    def stopwatch(self) -> float:
        """Return a time [s]. The difference between two such times is a duration in a tick."""

    @abstractmethod
    def wait(self) -> Tick:
        """Wait until the deadline of the next tick, and return the timing of this tick.

        The deadline of a tick is the time at which the tick should start. The first call does not
        wait, because the first tick starts immediately.
        """


class VirtualClock(Clock):
    """Clock with virtual time, which increases by one period at each tick.

    The virtual time does not depend on the speed of the machine. Trials are therefore repeatable.
    `stopwatch` also returns the virtual time, so that all durations within a tick are zero.
    """

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self._tick = -1
        self._now = 0.0

    def now(self) -> float:
        """Return the virtual time of the present tick [s], which is 0 at the first tick."""
        return self._now

    stopwatch = now

    def wait(self) -> Tick:
        """Set the virtual time to the deadline of the next tick, without waiting."""
        self._tick += 1
        self._now = self._tick / self.rate
        return ON_TIME


class RealClock(Clock):
    """Clock in real time. The deadline of tick n is n periods after the first tick.

    The deadline is the time at which the tick should start. A late tick does not change the later
    deadlines, so that delays do not accumulate. If a tick is late by one or more whole periods,
    these periods are skipped. The clock uses the monotonic clock of the machine.
    """

    def __init__(self, rate: float) -> None:
        super().__init__(rate)
        self._origin = time.monotonic_ns()
        self._spin = min(SPIN, round(LARGEST_SPIN * 1e9 / rate))
        self._first = self._woken = 0
        self._tick = -1

    def now(self) -> float:
        """Return the time since this object was created [s]."""
        return (time.monotonic_ns() - self._origin) * 1e-9

    def stopwatch(self) -> float:
        """Return the time of `time.perf_counter` [s], the clock with the highest resolution."""
        return time.perf_counter()

    def _deadline(self, tick: int) -> int:
        return self._first + round(tick * 1e9 / self.rate)

    def wait(self) -> Tick:
        """Wait until the deadline of the next tick, and return the timing of this tick.

        The method sleeps until shortly before the deadline. Then it reads the clock repeatedly,
        which is more exact than sleeping.
        """
        now = time.monotonic_ns()
        if self._tick < 0:
            self._first = self._woken = now
        due = self._deadline(self._tick + 1)
        skipped = max(0, int((now - due) * 1e-9 * self.rate))
        self._tick += 1 + skipped
        deadline = self._deadline(self._tick)
        if deadline - now > self._spin:
            time.sleep((deadline - now - self._spin) * 1e-9)
        busy = now - self._woken
        while (woken := time.monotonic_ns()) < deadline:
            pass
        self._woken = woken
        return Tick((woken - deadline) * 1e-9, now > due, skipped, busy * 1e-9)
