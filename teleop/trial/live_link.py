"""Connect the control process to the live process."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from time import monotonic
from typing import Any

from drivers.posix import is_posix, needs_posix
from sim_backend import PointerOperator
from teleop.errors import InputError, reason
from teleop.live.cells import PROCESS, SIZE, STOP, CellReader
from teleop.settings.trial_settings import TrialSettings
from teleop.streams.child_process import LIVE_PROCESS, ChildProcess
from teleop.streams.shared_file import SharedFile
from teleop.streams.stream import Stream
from teleop.trial.live_documents import result_document, trial_document
from teleop.trial.page_requests import WAITING_SILENCE, PagePointer, PageRequests
from teleop.trial.result import Trial


class LiveLink:
    """Starts the live process, and announces one or more trials to it.

    The live process reads the stream of each trial. A `port` of 0 is any free port; without a port
    `foxglove`, there is no server of the Foxglove protocol. `page` is the live process, if it was
    started before.

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
        try:
            cells = SharedFile.create(SIZE)
        except OSError as error:
            raise InputError(f"live page: cannot be started: {reason(error)}") from error
        with contextlib.ExitStack() as started:
            started.callback(self.end)
            welcome = {"may_arm": by_page, "pointer": pointer, "choices": choices}
            session = {"cells": str(cells.path), "host": host, "port": port, "welcome": welcome}
            self._page = page or ChildProcess(LIVE_PROCESS)
            self._children.append(self._page)
            if foxglove is not None:
                self._children.append(ChildProcess("teleop.live.foxglove_process", "Foxglove"))
            try:
                self._page.begin(session)
            finally:
                cells.remove()
            for viewers in self._children[1:]:
                viewers.begin({"foxglove": foxglove})
            started.pop_all()
        self.url = self._page.url
        self.foxglove_url = self._children[1].url if foxglove is not None else ""
        self._cells = CellReader(cells.buffer)
        self._beats, self._heard = 0, monotonic()
        """Number of heartbeats at the latest call of `is_running`, and time of the last change."""
        self._stops = 0
        """Number of STOP requests of the live page that had arrived when the last trial ended."""

    def make_operator(self) -> PointerOperator | None:
        """Return a new simulated operator, whose hand follows the pointer of the live page.

        The result is None if the argument `pointer` of the class is False.
        """
        return PointerOperator(PagePointer(self._cells)) if self._has_pointer else None

    def begin(self, settings: TrialSettings, stream: Stream) -> PageRequests:
        """Announce a trial to the live process, which opens its stream."""
        self.trials += 1
        begin = {
            "type": "begin",
            "stream": stream.document,
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

    def end_trial(self) -> None:
        """Announce the end of the trial to the live process, which continues to run."""
        self._stops = self._cells.counts[STOP]
        self.tell({"type": "end", "text": ""})

    def show_result(self, trial: Trial) -> None:
        """Evaluate a trial, and send its results to the live process, which shows them in the page.

        If the drives were not armed, or an estimator has failed, nothing is sent.
        """
        self.trial = trial
        if trial.armed and not trial.estimation_traceback:
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
        not end within `teleop.streams.child_process.END_TIME` is killed.
        """
        for child in self._children:
            child.ask_to_end()
        for child in self._children:
            child.end()
