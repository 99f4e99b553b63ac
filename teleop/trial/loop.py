"""A session: ticks from arming to standstill, pushed to whoever keeps them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers import Rig, RigError
from estimation import Bank
from teleop.control.clock import Clock
from teleop.recording.black_box import AFTER, BlackBox
from teleop.recording.message import Layout
from teleop.recording.sinks import Sink
from teleop.safety.events import ACTIVE, FAULT, IDLE
from teleop.trial.settings import TrialSettings
from teleop.trial.stop_switch import StopSwitch

END = "end of the trial"


class Session:
    """Runs a trial tick by tick on an opened rig.

    Parameters
    ----------
    settings
        What to run.
    clock
        What wakes the loop.
    rig
        The telemanipulator, opened.
    bank
        The estimators.
    layout
        The ticks' message.
    sinks
        Where ticks and events are pushed.
    box
        The black box.
    switch
        How a person stops it.
    """

    def __init__(
        self,
        settings: TrialSettings,
        clock: Clock,
        rig: Rig,
        bank: Bank,
        layout: Layout,
        sinks: Sequence[Sink],
        box: BlackBox,
        switch: StopSwitch,
    ) -> None:
        self.controller = settings.make_controller(rig, bank, clock)
        self.ticks = 0
        self._clock = clock
        self._layout = layout
        self._sinks = sinks
        self._box = box
        self._switch = switch
        self._last = settings.duration - 0.5 / settings.rate
        self._end = ""
        self._armed = False
        self._elapsed = 0
        """Periods of the clock, those that were skipped included."""
        self._leave = math.inf
        """After how many of them the session ends."""

    @property
    def error(self) -> Exception | None:
        """The first exception of a tick."""
        return self.controller.error

    def step(self) -> bool:
        """Run one tick; whether there is another.

        Raises
        ------
        RigError
            The drives did not get ready in the time of the trial.
        """
        tick = self._clock.wait()
        request = self._switch.request(not self._armed, self._end)
        record = self.controller.tick(tick, request)
        message = self._layout.pack(record, sum(sink.dropped for sink in self._sinks))
        self._box.push(message)
        for sink in self._sinks:
            sink.push(message)
        self.ticks += 1
        self._elapsed += 1 + tick.skipped
        if record.events:
            for event in record.events:
                self._box.event(event)
                for sink in self._sinks:
                    sink.event(event)
                if event.mode is ACTIVE:
                    self._armed = True
                elif event.mode is FAULT:
                    self._leave = self._elapsed + AFTER * self._clock.rate
        if record.t >= self._last or self.controller.over:
            self._end = END
        if record.mode is not IDLE or self.error:
            return self._elapsed < self._leave
        if self._end and not self._armed:
            raise RigError("the drives did not get ready in the time of the trial")
        return not (self._armed or self._switch.interrupted)
