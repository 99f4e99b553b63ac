"""Connect the control process to the live process, which serves the live page."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
from typing import Any

from sim_backend import PointerOperator
from teleop.errors import InputError, reason
from teleop.json_documents import dumps, loads
from teleop.live.cells import SIZE, STOP, CellReader
from teleop.live.ring import SLOTS, RingWriter, ring_size
from teleop.live.shared_file import SharedFile
from teleop.recording.cdr import CDR, MESSAGE_NAME
from teleop.recording.message import Layout
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.safety import Event
from teleop.trial.live_documents import trial_document
from teleop.trial.page_pointer import PagePointer
from teleop.trial.page_requests import PageRequests
from teleop.trial.result import Trial
from teleop.trial.settings import TrialSettings

EVENT_SLOTS, EVENT_SIZE = 128, 4096
"""Largest number of events in the ring buffer of events, and largest size of an event [bytes]."""
START_TIME = 20.0
"""Longest wait for the start of the live process [s]."""
END_TIME = 3.0
"""Longest wait for the end of the live process [s]."""
MOST_UNSENT = 1 << 20
"""Number of unsent bytes above which the live process is killed, because it hangs."""


class LiveLink(Sink):
    """Starts the live process, and sends it the ticks and events of one or more trials.

    Parameters
    ----------
    size
        Largest size of the message of a tick [bytes].
    host, port
        Address at which the page is served.
    by_page
        Whether the drives are armed from the live page.
    pointer
        Whether the mouse or touch pointer of the live page replaces the operator of the simulated
        rig.
    choices
        Values that can be chosen on the live page for the settings condition, specimen and
        duration.
    foxglove
        Port for viewers of the Foxglove protocol; 0 for any free port; None to start no Foxglove
        server.

    Attributes
    ----------
    url
        Address of the page.
    foxglove_url
        Address for viewers of the Foxglove protocol; empty if there is no Foxglove server.
    trials
        Number of trials so far.
    trial
        The latest trial that has ended; None before the end of the first trial.
    position, of
        Position of the next trial in a series, from 1, and number of trials of the series. Both are
        0 without a series.

    Raises
    ------
    InputError
        The live process cannot be started, or the address cannot be used.
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
    ) -> None:
        if os.name != "posix":
            raise InputError("live page: expected Linux or macOS")
        self.trials = 0
        self.trial: Trial | None = None
        self.position, self.of = 0, 0
        self._by_page, self._has_pointer = by_page, pointer
        self._unsent = b""
        self._received = b""
        sizes = {"ring": (SLOTS, size), "events": (EVENT_SLOTS, EVENT_SIZE)}
        with contextlib.ExitStack() as names:
            try:
                files = {name: SharedFile.create(ring_size(*of)) for name, of in sizes.items()}
                files["cells"] = SharedFile.create(SIZE)
                for file in files.values():
                    names.callback(file.remove)
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "teleop.live.process"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    bufsize=0,
                    start_new_session=os.name == "posix",
                )
            except OSError as error:
                raise InputError(f"live page: cannot be started: {reason(error)}") from error
            assert self._process.stdin
            assert self._process.stdout
            self._input, self._output = self._process.stdin, self._process.stdout
            os.set_blocking(self._input.fileno(), False)
            paths = {name: str(file.path) for name, file in files.items()}
            welcome = {"may_arm": by_page, "pointer": pointer, "choices": choices}
            session = {"files": paths, "host": host, "port": port, "welcome": welcome}
            self.tell({**session, **sizes, "foxglove": foxglove})
            ready = self.wait_for_request(START_TIME) or {"problem": "it did not start"}
        if "problem" in ready:
            self.end()
            raise InputError(f"live page: {ready['problem']}")
        self.url, self.foxglove_url = str(ready["url"]), str(ready.get("foxglove", ""))
        self._cells = CellReader(files["cells"].buffer)
        self._stops = 0
        """Number of STOP requests until the end of the last trial."""
        self._ring = RingWriter(files["ring"].buffer, *sizes["ring"])
        self._events = RingWriter(files["events"].buffer, *sizes["events"])

    def make_operator(self) -> PointerOperator | None:
        """Return a new operator that follows the page's pointer; None if `pointer` is False."""
        return PointerOperator(PagePointer(self._cells)) if self._has_pointer else None

    def begin(self, settings: TrialSettings, layout: Layout) -> PageRequests:
        """Announce a trial to the live pages, and return the object that reads their requests.

        Parameters
        ----------
        settings
            Settings of the trial.
        layout
            Layout of the message of a tick.
        """
        self.trials += 1
        self._move_off()
        self.tell(
            {
                "type": "begin",
                "first": self._ring.newest + 1,
                "first_event": self._events.newest + 1,
                "offset": len(CDR),
                "message": MESSAGE_NAME,
                "definition": layout.definition,
                "columns": [column._asdict() for column in layout.columns],
                "estimators": layout.estimators,
                "rate": settings.rate,
                "trial": trial_document(settings, self.trials, self.position, self.of),
                "by_page": self._by_page,
            }
        )
        return PageRequests(self._cells, self._by_page, self._stops)

    def push(self, message: bytes) -> None:
        """Write the message of one tick to the tick ring in shared memory."""
        self._ring.write(message)

    def event(self, event: Event) -> None:
        """Write an event to the event ring in shared memory."""
        self._events.write(dumps(event_record(event)).encode()[:EVENT_SIZE])

    def close(self) -> Outcome:
        """Announce the end of the trial to the live pages. The live process continues to run."""
        self._stops = self._cells.counts[STOP]
        self.tell({"type": "end", "text": ""})
        return Outcome(None, 0, 0, "")

    def show_result(self, trial: Trial) -> None:
        """Send the results of a trial to the live pages, if the drives were armed."""
        self.trial = trial
        if trial.armed:
            self.tell({"type": "summary", **trial.summary()})

    def tell(self, document: dict[str, Any]) -> None:
        """Send a message to the live process without waiting; kill a live process that hangs."""
        self._unsent += dumps(document).encode() + b"\n"
        try:
            while self._unsent:
                written = os.write(self._input.fileno(), self._unsent)
                self._unsent = self._unsent[written:]
        except BlockingIOError:
            if len(self._unsent) > MOST_UNSENT:
                self._process.kill()
        except (OSError, ValueError):
            self._unsent = b""

    def wait_for_request(self, timeout: float) -> dict[str, Any] | None:
        """Return the next request of a live page, while no trial runs.

        Parameters
        ----------
        timeout
            Longest wait [s].

        Returns
        -------
        The request; None if there was no request, or if the live process has ended.
        """
        while b"\n" not in self._received:
            readable, _, _ = select.select([self._output], [], [], timeout)
            part = os.read(self._output.fileno(), 1 << 16) if readable else b""
            if not part:
                return None
            self._received += part
        line, _, self._received = self._received.partition(b"\n")
        return loads(line)

    @property
    def is_running(self) -> bool:
        """Whether the live process is running."""
        return self._process.poll() is None

    def end(self) -> None:
        """End the live process. Before it ends, it informs the live pages."""
        with contextlib.suppress(OSError):
            self._input.close()
        try:
            self._process.wait(END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._output.close()

    def _move_off(self) -> None:
        """Move the live process to processors other than that of the control loop."""
        if not hasattr(os, "sched_setaffinity"):
            return
        own = os.sched_getaffinity(0)
        with contextlib.suppress(OSError):
            others = os.sched_getaffinity(self._process.pid) - own
            if len(own) == 1 and others:
                os.sched_setaffinity(self._process.pid, others)
