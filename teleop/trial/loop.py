"""Run the control loop of a trial until standstill, and write each tick to the stream."""

from __future__ import annotations

import math

from drivers import RigError
from teleop.control.clock import Clock
from teleop.control.controller import Controller
from teleop.recording.black_box import AFTER
from teleop.safety.events import ACTIVE, FAULT, IDLE, Event, Fault, is_note
from teleop.streams.stream import Stream
from teleop.trial.readers import Readers
from teleop.trial.stop_switch import StopSwitch

END = "end of the trial"
"""Reason for the stop when the duration of the trial has elapsed."""


class Loop:
    """Runs the control loop of a trial. The devices of the rig must be open.

    Attributes
    ----------
    ticks
        Number of ticks so far.
    """

    def __init__(
        self,
        controller: Controller,
        clock: Clock,
        stream: Stream,
        readers: Readers,
        switch: StopSwitch,
        duration: float,
    ) -> None:
        self.controller = controller
        self.ticks = 0
        self._clock = clock
        self._stream = stream
        self._readers = readers
        self._switch = switch
        self._last = duration - 0.5 * clock.period
        self._end = ""
        self._armed = False
        self._begin = 0.0
        """Time from which the duration of the trial is measured [s]."""
        self._time = 0.0
        """Time of the latest tick [s]."""
        self._unstopped = False
        """Whether the drives have not confirmed a stop."""
        self._elapsed = 0
        """Number of periods of the clock so far, including skipped periods."""
        self._leave = math.inf
        """Number of periods after which the loop ends at the latest; infinite before a stop."""

    @property
    def error(self) -> Exception | None:
        """First exception in a tick; None if there was none."""
        return self.controller.error

    def run(self) -> None:
        """Run the control loop until the trial has ended."""
        while self.step():
            pass

    def end_unstopped(self, text: str) -> None:
        """Write the fault that a drive did not confirm the stop after the last tick.

        `text` describes the fault. If it was detected in the loop already, nothing is written.
        """
        if not self._unstopped:
            now, source = self._time, Fault.NOT_STOPPED
            self._stream.event(Event(now, FAULT, f"{source}: {text}", source, text, since=now))

    def step(self) -> bool:
        """Run one tick, and return whether the loop continues."""
        tick = self._clock.wait()
        request = self._switch.request(not self._armed, self._end)
        record = self.controller.tick(tick, request)
        self._stream.write(record)
        self.ticks += 1
        self._elapsed += 1 + tick.skipped
        self._time = record.t
        for event in record.events:
            self._stream.event(event)
            self._unstopped |= event.fault is Fault.NOT_STOPPED
            if event.mode is ACTIVE and not is_note(event.fault, event.source):
                self._armed, self._begin = True, event.time
            elif event.mode is FAULT or (event.mode is IDLE and self._armed):
                self._leave = self._elapsed + AFTER * self._clock.rate
        if not (self._armed or self._switch.arms):
            self._begin = record.t
        self._readers.after_tick(record)
        self._end = self._end or self._readers.end_reason
        if record.t - self._begin >= self._last or self.controller.finished:
            self._end = self.controller.ending or self._end or END
        if record.mode is not IDLE or self.error:
            return self._elapsed < self._leave
        if self._end and not self._armed:
            raise RigError(
                "the drives did not get ready: expected them to be ready within the duration of "
                "the trial"
            )
        if self._armed:  # a drive that moves on is a fault, see docs/safety.md
            return self.controller.stops and self._elapsed < self._leave
        return not self._switch.interrupted
