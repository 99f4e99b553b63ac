"""Read the requests of the live page during a trial, at each tick, from shared memory.

The live process sends heartbeats. The page confirms the times of the data that it receives, so that
their age is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from time import monotonic

from teleop.live.cells import ARM, END, LONGEST_ROUND_TRIP, PROCESS, STOP, CellReader
from teleop.safety import Fault
from teleop.safety.channels import DetectedFault

POINTER_SILENCE = 0.15
"""Longest time between two samples of the pointer while the hand holds the handle [s]."""


class PagePointer:
    """Callable that returns the latest position of the pointer in the live page.

    The hand of a simulated operator follows the pointer. If no new sample of the pointer arrives
    for longer than `POINTER_SILENCE`, the hand no longer holds the handle. It does not hold the
    handle either while the page is more than `LONGEST_ROUND_TRIP` behind, because the person then
    sees and moves too late.
    """

    def __init__(self, cells: CellReader, now: Callable[[], float] = monotonic) -> None:
        self._cells = cells
        self._now = now
        self._sequence = -1
        self._time = -POINTER_SILENCE
        self._depth, self._grip = 0.0, False
        if sample := cells.pointer():
            self._sequence = sample[0]

    def __call__(self) -> tuple[float, bool]:
        """Return the wanted position of the hand [m], and whether the hand holds the handle.

        A person sets both with the pointer in the live page.
        """
        now = self._now()
        sample = self._cells.pointer()
        if sample and sample[0] != self._sequence:
            self._sequence, self._depth, self._grip = sample
            self._time = now
        is_late = self._cells.age(self._now) > LONGEST_ROUND_TRIP
        return self._depth, self._grip and now - self._time <= POINTER_SILENCE and not is_late


PROCESS_SILENCE = 0.3
"""Longest time between two heartbeats of the live process, if the live page armed the drives
[s]."""
WAITING_SILENCE = 5.0
"""Longest time between two heartbeats of the live process while a trial waits for START, or a
question for its answer, and nothing moves [s]. It is longer than `PROCESS_SILENCE`, because a busy
machine may delay the live process. It is finite, because a command that waits for a page that
nobody can use must end."""
PAGE_AGE = 1.0
"""Greatest age of the newest data that the live page that controls the trial has confirmed, if a
page armed the drives [s]. The age contains the round trip of the connection, and the time for which
the page or the connection is silent. It is three times the round trip that is permitted when the
drives are armed, so that a short delay of the network or of the browser does not end the trial."""
STOPPED = DetectedFault(Fault.EMERGENCY_STOP, "live page", math.nan, math.nan, math.nan)
"""Fault that is reported when STOP is pressed in the live page."""


class NoPage:
    """Replacement for `PageRequests` in a trial without a live page.

    There is no page in which a person can make requests. The drives may therefore be armed without
    a request.
    """

    reason = ""
    """Reason why the live page ended the trial; empty if the page did not end it."""
    faults: tuple[DetectedFault, ...] = ()
    """Faults caused by the live page: STOP was pressed, or the page no longer responds."""
    arms = True
    """Whether the drives may be armed (permitted to move)."""

    def read(self) -> None:
        """Do nothing. In `PageRequests`, this method reads the requests of the live page."""


class PageRequests(NoPage):
    """Requests that a person makes in the live page during one trial.

    A request that was made before the trial has no effect on the trial, with one exception: if
    `by_page` is False, a STOP request between two trials stops the next trial.
    """

    def __init__(
        self,
        cells: CellReader,
        by_page: bool,
        stops: int = 0,
        now: Callable[[], float] = monotonic,
    ) -> None:
        self.arms = not by_page
        self._counts = cells.counts
        self._by_page = by_page
        self._now = now
        counts = self._counts
        self._stop = counts[STOP] if by_page else stops
        self._end, self._arm = counts[END], counts[ARM]
        self._cells = cells
        self._beats = counts[PROCESS]
        self._heard = now()

    def read(self) -> None:
        """Read the requests of the live page from shared memory.

        The results are stored in the attributes `reason`, `faults` and `arms`. The control loop
        calls this method at the start of each tick.
        """
        counts = self._counts
        if counts[STOP] != self._stop:
            self.faults = (STOPPED,)
        if counts[END] != self._end:
            self.reason = "ended from the live page"
        if self._by_page:
            self._check_heartbeats()
            if counts[ARM] != self._arm and not self.arms:
                # A START that waited in a live process that hung has no effect, now or later: it
                # is old, and the silence would stop the drives in the next tick.
                self._arm = counts[ARM]
                self.arms = self._now() - self._heard <= PROCESS_SILENCE and (
                    self._cells.age(self._now) <= PAGE_AGE
                )

    def _check_heartbeats(self) -> None:
        beats, now = self._counts[PROCESS], self._now()
        if beats != self._beats:
            self._beats, self._heard = beats, now
        longest = PROCESS_SILENCE if self.arms else WAITING_SILENCE
        if now - self._heard > longest:
            self._lose(f"the live process was silent for {longest:g} s")
        elif self.arms and self._cells.age(self._now) > PAGE_AGE:
            self._lose(f"the page has confirmed no data of the last {PAGE_AGE:g} s")

    def _lose(self, cause: str) -> None:
        """End the trial, because the live page or the process that serves it no longer responds.

        If nobody has pressed START yet, the trial ends without a fault, because nothing moves.
        Otherwise, a fault stops the drives.
        """
        if not self.arms:
            self.reason = self.reason or cause
        elif not self.faults:
            nan = math.nan
            self.faults = (DetectedFault(Fault.PAGE_LOST, cause, nan, nan, nan),)
