"""End a trial when the result of the evaluation is as precise as wanted.

In virtual time, the record is evaluated within the loop, so that the same seed gives the same end.
In real time, another process evaluates it: even a thread would delay the loop.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from drivers.posix import is_posix, needs_posix
from teleop.control.wanted_precision import WantedPrecision
from teleop.errors import InputError, reason
from teleop.live.ring import RingWriter, ring_size
from teleop.live.shared_file import SharedFile
from teleop.recording.columns import Layout
from teleop.recording.message import TIME
from teleop.recording.recording import from_messages
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.safety import Event
from teleop.safety.events import ACTIVE, is_note
from teleop.trial.child_process import START_TIME, ChildProcess

if TYPE_CHECKING:
    from teleop.trial.precision_watch import PrecisionWatch

SOURCE = "precision"
"""Source of the events that state the precision."""
STORED = 5.0
"""Time for which the ring buffer stores ticks, while the process evaluates the earlier ones [s]."""
POLL = 50
"""Number of ticks between two looks for an answer of the process that evaluates."""


class Precision(Sink):
    """Ends a trial when it is as precise as wanted, and states the precision until then.

    `sinks` get each statement as an event. `begin` must be called before the first tick.
    """

    def __init__(
        self,
        wanted: WantedPrecision,
        layout: Layout,
        metadata: dict[str, dict[str, str]],
        duration: float,
        rate: float,
        sinks: Sequence[Sink],
    ) -> None:
        self._session: dict[str, Any] = {
            "wanted": wanted.text,
            "definition": layout.definition,
            "metadata": metadata,
            "duration": duration,
        }
        self._wanted, self._sinks = wanted, sinks
        self._pushed = 0
        self._open(layout, rate)

    def _open(self, layout: Layout, rate: float) -> None:
        """Create what the evaluation needs."""

    def begin(self) -> None:
        """Prepare the evaluation."""

    def event(self, event: Event) -> None:
        """Begin the evaluation when the drives are armed."""
        if event.mode is ACTIVE and not is_note(event.fault, event.source):
            self._arm(event_record(event))

    def _arm(self, event: dict[str, Any]) -> None:
        """Begin the evaluation. The argument is the event at which the drives were armed."""

    def _state(self, t: float, text: str, is_reached: bool) -> None:
        """Pass an event with the precision at the time t [s] to the other sinks."""
        note = Event(t, ACTIVE, f"{self._wanted.text}: {text}", source=SOURCE)
        for sink in self._sinks:
            sink.event(note)
        if is_reached:
            self.end_reason = text

    def close(self) -> Outcome:
        """Return the number of received ticks. There is no file to close."""
        return Outcome(None, self._pushed, 0, "")


class PrecisionInLoop(Precision):
    """Evaluates the record within the loop of a trial in virtual time."""

    _watch: PrecisionWatch | None = None
    _ticks = bytearray()

    def push(self, message: bytes) -> None:
        """Receive a tick; evaluate the record if this is due."""
        self._pushed += 1
        if self._watch is None:  # the event at which the drives are armed follows its tick
            self._ticks = bytearray(message)
            return
        self._ticks += message
        t = TIME.unpack_from(message)[0]
        if self._watch.is_due(t):
            self._watch.add(from_messages(self._session["definition"], self._ticks, [], {}).columns)
            self._ticks.clear()
            self._state(t, *self._watch.evaluate(t))

    def _arm(self, event: dict[str, Any]) -> None:
        from teleop.trial.precision_watch import watch_of  # imports scipy, which takes long

        self._watch = watch_of(self._session, event)


class PrecisionProcess(Precision):
    """Lets another process evaluate the record of a trial in real time."""

    def _open(self, layout: Layout, rate: float) -> None:
        if not is_posix():
            raise InputError(f"{needs_posix('until')}, or clock virtual")
        size = round(STORED * rate), layout.size
        try:
            self._file = SharedFile.create(ring_size(*size))
        except OSError as error:
            raise InputError(f"until: no memory for the ticks: {reason(error)}") from error
        self._ring = RingWriter(self._file.buffer, *size)
        self._session |= {"file": str(self._file.path), "ring": size}
        try:
            self._process = ChildProcess("teleop.trial.precision_process", "until")
        except InputError:
            self._file.remove()
            raise

    def begin(self) -> None:
        """Wait until the process is ready, so that its start does not delay the loop."""
        self._process.tell(self._session)
        ready = self._process.wait_for_request(START_TIME)
        self._file.remove()
        if ready is None:
            raise InputError("until: the process that evaluates did not start")
        self._process.move_off()

    def push(self, message: bytes) -> None:
        """Pass a tick to the process, and look for its answer once per `POLL` ticks."""
        self._ring.write(message)
        self._pushed += 1
        if self._pushed % POLL or self.end_reason:
            return
        if answer := self._process.wait_for_request(0.0):
            self._state(TIME.unpack_from(message)[0], answer["text"], answer["is_reached"])

    def _arm(self, event: dict[str, Any]) -> None:
        self._process.tell({"armed": event})

    def close(self) -> Outcome:
        """End the process, and return the number of received ticks."""
        self._file.remove()
        with contextlib.suppress(OSError):
            self._process.end()
        return super().close()
