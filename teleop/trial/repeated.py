"""Repeat a recorded trial in which a person moved the handle with the pointer of the live page.

The repetition on the simulated rig gives the same numbers as the recorded trial.
"""

from __future__ import annotations

import math

from sim_backend import PointerOperator
from teleop.control.clock import Clock, Tick
from teleop.errors import InputError
from teleop.recording.recording import Recording, from_columns
from teleop.safety import Fault
from teleop.safety.channels import DetectedFault
from teleop.safety.events import ACTIVE, is_note
from teleop.settings.documents import from_document
from teleop.streams.columns import POINTER
from teleop.streams.stream import Stream
from teleop.trial.assembly import make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.metadata import session_metadata
from teleop.trial.page_requests import NoPage
from teleop.trial.readers import ReadersInLoop
from teleop.trial.stop_switch import StopSwitch

BY_PERSON = (Fault.EMERGENCY_STOP, Fault.PAGE_LOST)
"""Faults that a person or the live page caused. The data of the rig do not contain their cause."""


class RecordedClock(Clock):
    """Clock that returns the times in a recording, so that the recorded trial can be repeated.

    The clock does not wait.
    """

    def __init__(self, recording: Recording, rate: float) -> None:
        super().__init__(rate)
        self._times = recording["pointer_clock"].tolist()
        names = ("lateness", "overrun", "skipped", "busy_time")
        self._ticks = list(zip(*(recording[name].tolist() for name in names), strict=True))
        self.tick = -1

    def now(self) -> float:
        """Return the recorded time of the present tick [s]."""
        return float(self._times[max(self.tick, 0)])

    stopwatch = now

    def wait(self) -> Tick:
        """Advance to the next tick, and return its recorded timing."""
        self.tick += 1
        lateness, overrun, skipped, busy = self._ticks[self.tick]
        return Tick(lateness, bool(overrun), int(skipped), busy)


class RecordedRequests(NoPage):
    """Requests that a person made in a recorded trial, in the live page or the terminal.

    When the trial is repeated, this object replaces `PageRequests`. The requests were not recorded.
    They are computed from the recorded modes of the safety supervisor, and from its events (faults
    and changes of the mode).
    """

    arms = False

    def __init__(self, recording: Recording) -> None:
        self._ticks = zip(recording["time"].tolist(), recording["mode"].tolist(), strict=True)
        events = (e for e in recording.events if not is_note(e["fault"], e.get("source", "")))
        self._events = {event["time"]: event for event in events}

    def read(self) -> None:
        """Compute the requests that a person made at the next tick of the recorded trial.

        The results are stored in the attributes `arms`, `reason` and `faults`.
        """
        t, mode = next(self._ticks)
        self.arms = self.arms or mode == ACTIVE
        event = self._events.get(t)
        if event and event["mode"] == "stopping":
            self.reason = event["text"]
        elif event and event["fault"] in BY_PERSON:
            nan = math.nan
            fault = Fault(event["fault"])
            self.faults = (DetectedFault(fault, event["source"], nan, nan, nan),)


def repeated(recording: Recording) -> Recording:
    """Repeat a recorded trial in which a person moved the handle with the pointer of the live page.

    The trial is repeated on the simulated rig in virtual time, with the recorded times and the
    recorded positions of the pointer.

    Parameters
    ----------
    recording
        Recording of `teleop run --live --operator pointer`.

    Returns
    -------
    Recording of the repetition. It contains the same numbers as `recording`, except the durations
    of reading, computing and writing in each tick.

    Raises
    ------
    InputError
        The recording contains no positions of a pointer, ticks are missing, or a recorded setting
        is not valid.
    """
    if any(column.name not in recording.columns for column in POINTER):
        raise InputError("the recording has no pointer: expected a trial with --operator pointer")
    if recording.gaps:
        raise InputError("ticks of the recording are missing: expected a complete recording")
    settings = from_document(recording.settings)
    clock = RecordedClock(recording, settings.loop_rate)
    depths, grips = recording["pointer_depth"].tolist(), recording["pointer_grip"].tolist()
    pointer = PointerOperator(lambda: (depths[clock.tick], bool(grips[clock.tick])))
    bank, switch = settings.estimation_preset.bank(), StopSwitch()
    stream = Stream(make_layout(settings, bank, pointer), len(recording))
    readers = ReadersInLoop(stream, settings, bank)
    switch.page = RecordedRequests(recording)
    with make_simulated_rig(settings, clock.now, pointer=pointer) as rig:
        controller = make_controller(settings, rig, clock)
        loop = Loop(controller, clock, stream, readers, switch, settings.duration)
        for _ in range(len(recording)):
            loop.step()
    readers.close()
    columns = stream.reader().columns(1, stream.newest + 1)
    return from_columns(stream.schema, columns, stream.events, session_metadata(settings))
