"""Run the control loop of a trial until standstill, and pass the data of each tick to the sinks.

A sink is an object that receives the message of each tick, for example the recorder.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers import RigError
from teleop.control.clock import Clock
from teleop.control.controller import Controller
from teleop.recording.black_box import AFTER
from teleop.recording.message import Layout
from teleop.recording.sinks import Sink
from teleop.safety.events import ACTIVE, FAULT, IDLE
from teleop.trial.stop_switch import StopSwitch

END = "end of the trial"
"""Reason for the stop when the duration of the trial has elapsed."""


class Loop:
    """Runs a trial tick by tick on an opened rig.

    Parameters
    ----------
    controller
        The controller of the rig.
    clock
        The clock of the loop.
    layout
        Layout of the message of a tick.
    sinks
        Receivers of the ticks and events, such as the recorder and the black box.
    switch
        Stop switch, by which a person stops the trial.
    duration
        Duration of the trial [s].

    Attributes
    ----------
    ticks
        Number of ticks so far.
    """

    def __init__(
        self,
        controller: Controller,
        clock: Clock,
        layout: Layout,
        sinks: Sequence[Sink],
        switch: StopSwitch,
        duration: float,
    ) -> None:
        self.controller = controller
        self.ticks = 0
        self._clock = clock
        self._layout = layout
        self._sinks = sinks
        self._switch = switch
        self._last = duration - 0.5 * clock.period
        self._end = ""
        self._armed = False
        self._begin = 0.0
        """Time at which the measurement of the duration starts [s]."""
        self._elapsed = 0
        """Number of periods of the clock so far, including skipped periods."""
        self._leave = math.inf
        """Number of periods after which the loop ends; infinite until the end is decided."""

    @property
    def error(self) -> Exception | None:
        """First exception that occurred in a tick; None if there was no exception."""
        return self.controller.error

    def run(self) -> None:
        """Run ticks until the trial has ended.

        Raises
        ------
        RigError
            The drives were not ready within the duration of the trial.
        """
        while self.step():
            pass

    def step(self) -> bool:
        """Run one tick, and return whether the loop continues.

        Raises
        ------
        RigError
            The drives were not ready within the duration of the trial.
        """
        tick = self._clock.wait()
        request = self._switch.request(not self._armed, self._end)
        record = self.controller.tick(tick, request)
        sinks, dropped = self._sinks, 0
        for sink in sinks:
            dropped += sink.dropped
        message = self._layout.pack(record, dropped)
        for sink in sinks:
            sink.push(message)
        self.ticks += 1
        self._elapsed += 1 + tick.skipped
        for event in record.events:
            for sink in self._sinks:
                sink.event(event)
            if event.mode is ACTIVE:
                self._armed, self._begin = True, event.time
            elif event.mode is FAULT:
                self._leave = self._elapsed + AFTER * self._clock.rate
        if not (self._armed or self._switch.page.arms):
            self._begin = record.t
        if record.t - self._begin >= self._last or self.controller.finished:
            self._end = END
        if record.mode is not IDLE or self.error:
            return self._elapsed < self._leave
        if self._end and not self._armed:
            raise RigError(
                "the drives did not get ready: expected them to be ready within the duration of "
                "the trial"
            )
        return not (self._armed or self._switch.interrupted)
