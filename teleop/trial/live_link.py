"""Connect the control process to the live process."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from time import monotonic
from typing import Any

from drivers.posix import is_posix, needs_posix
from sim_backend import PointerOperator
from teleop.errors import InputError, reason
from teleop.json_documents import dumps
from teleop.live.cells import PROCESS, SIZE, STOP, CellReader
from teleop.live.ring import SLOTS, RingWriter, ring_size
from teleop.live.shared_file import SharedFile
from teleop.recording.columns import Layout
from teleop.recording.message import CDR, MESSAGE_NAME
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.safety import Event
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.child_process import LIVE_PROCESS, ChildProcess
from teleop.trial.live_documents import result_document, trial_document
from teleop.trial.page_requests import WAITING_SILENCE, PagePointer, PageRequests
from teleop.trial.result import Trial

EVENT_SLOTS, EVENT_SIZE = 128, 8192
"""Largest number of events in the ring buffer of events, and largest size of an event [bytes]. The
texts of an event have up to 500 characters, each of which needs up to 12 bytes (see `dumps`)."""


class LiveLink(Sink):
    """Starts the live process, and sends it the data of one or more trials.

    The data are the recorded values of each tick and the events. A `port` of 0 is any free port;
    without a port `foxglove`, there is no server of the Foxglove protocol. `page` is the live
    process, if it was started before.

    Attributes
    ----------
    url
        Address of the live page.
    foxglove_url
        Address of the server for viewers of the Foxglove protocol; empty if there is no such
        server.
    trials
        Number of trials that have begun.
    trial
        Result of the latest trial that has ended; None before the end of the first trial.
    position, of
        Position of the next trial in a series (1 for the first trial), and number of trials in the
        series. Both are 0 if there is no series.
    """

    def __init__(
        self,
        size: int,
        host: str,
        port: int,
        by_page: bool,
        pointer: bool,
        choices: dict[str, list[Any]],
        foxglove: int | None = None,
        page: ChildProcess | None = None,
    ) -> None:
        if not is_posix():
            raise InputError(needs_posix("live page"))
        self.trials = 0
        self.trial: Trial | None = None
        self.position, self.of = 0, 0
        self._prompt = 0
        """Number of the latest question, see `ask`."""
        self.by_page, self._has_pointer = by_page, pointer
        self._children: list[ChildProcess] = []
        sizes = {"ring": (SLOTS, size), "events": (EVENT_SLOTS, EVENT_SIZE)}
        with contextlib.ExitStack() as names, contextlib.ExitStack() as started:
            files: dict[str, SharedFile] = {}
            try:
                for name in (*sizes, "cells"):
                    needed = ring_size(*sizes[name]) if name in sizes else SIZE
                    files[name] = SharedFile.create(needed)
                    names.callback(files[name].remove)
            except OSError as error:
                raise InputError(f"live page: cannot be started: {reason(error)}") from error
            started.callback(self.end)
            paths = {name: str(file.path) for name, file in files.items()}
            welcome = {"may_arm": by_page, "pointer": pointer, "choices": choices}
            session = {"files": paths, "host": host, "port": port, "welcome": welcome, **sizes}
            self._page = page or ChildProcess(LIVE_PROCESS)
            self._children.append(self._page)
            if foxglove is not None:
                self._children.append(ChildProcess("teleop.live.foxglove_process"))
            self._page.begin(session)
            for viewers in self._children[1:]:
                viewers.begin({"files": paths, "foxglove": foxglove, **sizes})
            started.pop_all()
        self.url = self._page.url
        self.foxglove_url = self._children[1].url if foxglove is not None else ""
        self._cells = CellReader(files["cells"].buffer)
        self._beats, self._heard = 0, monotonic()
        """Number of heartbeats at the latest call of `is_running`, and time of the last change."""
        self._stops = 0
        """Number of STOP requests of the live page that had arrived when the last trial ended."""
        self._ring = RingWriter(files["ring"].buffer, *sizes["ring"])
        self._events = RingWriter(files["events"].buffer, *sizes["events"])

    def make_operator(self) -> PointerOperator | None:
        """Return a new simulated operator, whose hand follows the pointer of the live page.

        The result is None if the argument `pointer` of the class is False.
        """
        return PointerOperator(PagePointer(self._cells)) if self._has_pointer else None

    def begin(self, settings: TrialSettings, layout: Layout) -> PageRequests:
        """Announce a trial to the live process."""
        self.trials += 1
        begin = {
            "type": "begin",
            "first": self._ring.newest + 1,
            "first_event": self._events.newest + 1,
            "offset": len(CDR),
            "message": MESSAGE_NAME,
            "definition": layout.definition,
            "columns": [column._asdict() for column in layout.columns],
            "estimators": layout.estimators,
            "rate": settings.loop_rate,
            "trial": trial_document(settings, self.trials, self.position, self.of),
            "by_page": self.by_page,
        }
        # A request that the live process makes because of `begin` concerns this trial.
        requests = PageRequests(self._cells, self.by_page, self._stops)
        for child in self._children:
            child.move_off()
            child.tell(begin)
        return requests

    def push(self, message: bytes) -> None:
        """Send all recorded values of one tick to the live process.

        `message` contains these values as bytes. It is written to a ring buffer in shared memory,
        from which the live process reads it.
        """
        self._ring.write(message)

    def event(self, event: Event) -> None:
        """Send an event to the live process, through a ring buffer in shared memory."""
        self._events.write(dumps(event_record(event)).encode())

    def close(self) -> Outcome:
        """Announce the end of the trial to the live process, which continues to run.

        The returned `Outcome` is empty, because this object does not write a recording.
        """
        self._stops = self._cells.counts[STOP]
        self.tell({"type": "end", "text": ""})
        return Outcome(None, 0, 0, "")

    def show_result(self, trial: Trial) -> None:
        """Evaluate a trial, and send its results to the live process, which shows them in the page.

        If the drives were not armed in the trial, nothing is sent.
        """
        self.trial = trial
        if trial.armed:
            self.tell({"type": "evaluating"})
            summary = trial.summary()
            shown = result_document(trial.result, summary["estimates"])
            self.tell({"type": "summary", **summary, **shown})

    def tell(self, document: dict[str, Any]) -> None:
        """Send a message to the live process. Do not wait."""
        self._page.tell(document)

    def refuse(self) -> None:
        """Report to the live process that a trial could not begin. The question states why."""
        self.tell({"type": "refused"})

    def ask(self, text: str, answers: Sequence[str], advice: str) -> None:
        """Show a question in the live page, which `wait_for_request` then waits to be answered.

        `advice` states what the buttons do. Only a page that can press them shows it.

        The question gets a new number. An answer contains the number of its question, so that an
        answer to an earlier question, such as the second press of a button, has no effect.
        """
        self._prompt += 1
        prompt = {"number": self._prompt, "text": text, "answers": [*answers], "advice": advice}
        self.tell({"type": "prompt", **prompt})

    def wait_for_request(self, timeout: float) -> dict[str, Any] | None:
        """Wait for the next request that a person makes in the live page, and return it.

        The result is None if there was no request, or if the live process has ended.

        This method is used between two trials. During a trial, `PageRequests` reads the requests.
        Answers to an earlier question are discarded, see `ask`.
        """
        while (request := self._page.wait_for_request(timeout)) is not None:
            if request.get("prompt", self._prompt) == self._prompt:
                return request
        return None

    @property
    def is_running(self) -> bool:
        """Whether the live process is running and sends heartbeats.

        A live process that hangs sends none. This is not detected before the second call.
        """
        beats, now = self._cells.counts[PROCESS], monotonic()
        if beats != self._beats:
            self._beats, self._heard = beats, now
        return self._page.is_running and now - self._heard <= WAITING_SILENCE

    @property
    def pid(self) -> int:
        """Process id of the live process."""
        return self._page.pid

    def end(self) -> None:
        """End the processes that show the data.

        Before it ends, the live process reports the end to the open live pages. A process that does
        not end within `teleop.trial.child_process.END_TIME` is killed.
        """
        for child in self._children:
            child.ask_to_end()
        for child in self._children:
            child.end()
