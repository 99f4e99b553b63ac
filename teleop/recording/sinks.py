"""Where the loop pushes its ticks: a recorder process behind a pipe, or memory."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from teleop.errors import InputError, reason
from teleop.json_documents import finite
from teleop.recording.message import Layout
from teleop.recording.process import BEGIN, END, EVENT, FRAME, HEAD, NUMBER, TICK
from teleop.safety import Event

PIPE_SIZE = 1 << 20
"""Wanted size of the pipe [bytes], some two seconds of ticks; what Linux grants to anyone."""
F_SETPIPE_SZ = 1031
"""Linux's name for it, which Python's fcntl has under that name on Linux alone."""
LONGEST_TEXT = 400
"""Characters of an event's text."""
PATIENCE = 20.0
"""How long the recorder is given to start and to finish [s]."""


class Outcome(NamedTuple):
    """State of a recording at its end."""

    path: Path | None
    pushed: int
    """Ticks that the loop handed over."""
    dropped: int
    """Ticks that found the pipe full: they are not in the file."""
    problem: str
    """Why the file does not hold all ticks that were handed over; empty if it does."""
    at_path: bool = True
    """Whether the file is still at its path."""


class Sink(ABC):
    """Takes in the loop's ticks and events; never makes the loop wait for a disk."""

    dropped = 0
    """Ticks that were not taken in."""

    @abstractmethod
    def push(self, message: bytes) -> None:
        """Take in the message of one tick."""

    @abstractmethod
    def event(self, event: Event) -> None:
        """Take in an event."""

    @abstractmethod
    def close(self) -> Outcome:
        """Finish, and say what became of it."""


class Memory(Sink):
    """Keeps everything."""

    def __init__(self) -> None:
        self.messages = bytearray()
        self.events: list[dict[str, Any]] = []
        self._pushed = 0

    def push(self, message: bytes) -> None:
        """Keep the message of one tick."""
        self.messages += message
        self._pushed += 1

    def event(self, event: Event) -> None:
        """Keep an event."""
        self.events.append(event_record(event))

    def close(self) -> Outcome:
        """All of it is here."""
        return Outcome(None, self._pushed, 0, "")


class RecorderProcess(Sink):
    """A recorder in a process of its own.

    Parameters
    ----------
    path
        The MCAP file; None to show the progress line alone.
    layout
        The ticks' message.
    metadata
        Named records of text about the session.
    duration
        Length of the trial [s], for the progress line.
    show
        Whether to draw that.
    wait
        Whether a full pipe holds the loop, for virtual time; in real time the tick is dropped.
    overwrite
        Whether the file may exist.
    hint
        What stops the run, for the progress line.
    instructions
        How to stop the run, for a line at the start.
    """

    def __init__(
        self,
        path: Path | None,
        layout: Layout,
        metadata: Mapping[str, Mapping[str, str]],
        duration: float,
        show: bool,
        wait: bool,
        overwrite: bool = False,
        hint: str = "",
        instructions: str = "",
    ) -> None:
        self.path = path
        self._pushed = 0
        self._waiting: list[bytes] = []
        self._gone = ""
        self._head = FRAME.pack(TICK, layout.size)
        self._wait = wait
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "teleop.recording.process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                bufsize=0,
                start_new_session=os.name == "posix",
            )
        except OSError as error:
            raise InputError(f"the recorder process cannot be started: {reason(error)}") from error
        assert self.process.stdin
        assert self.process.stdout
        self._pipe = self.process.stdin.fileno()
        session = {
            "path": str(path) if path else None,
            "columns": layout.columns,
            "estimators": layout.estimators,
            "definition": layout.definition,
            "metadata": metadata,
            "duration": duration,
            "show": show,
            "hint": hint,
            "instructions": instructions,
            "overwrite": overwrite,
        }
        data = json.dumps(session).encode()
        try:
            self.process.stdin.write(HEAD.pack(len(data)) + data)
        except BrokenPipeError:
            self._gone = "the recorder did not start"

    def begin(self, start: int) -> None:
        """Wait until the file is open; then ticks may be pushed.

        Parameters
        ----------
        start
            Wall-clock time of the trial's beginning [ns].

        Raises
        ------
        InputError
            It cannot be written, or the recorder does not start.
        """
        status = self._status()
        if status is None or status["problem"]:
            self.process.kill()
            self._release()
            why = status["problem"] if status else "the recorder did not start"
            raise InputError(f"{self.path or 'progress line'}: cannot be recorded to: {why}")
        with contextlib.suppress(BrokenPipeError):
            os.write(self._pipe, number_frame(BEGIN, start))
        if sys.platform == "linux":
            import fcntl

            fcntl.fcntl(self._pipe, F_SETPIPE_SZ, PIPE_SIZE)
        if not self._wait and hasattr(os, "set_blocking"):
            os.set_blocking(self._pipe, False)

    def push(self, message: bytes) -> None:
        """Hand over one tick, or count it as dropped."""
        if self._gone:
            return
        try:
            while self._waiting:
                self._waiting[0] = self._waiting[0][os.write(self._pipe, self._waiting[0]) :]
                if self._waiting[0]:
                    raise BlockingIOError
                self._waiting.pop(0)
            frame = self._head + message
            if rest := frame[os.write(self._pipe, frame) :]:
                self._waiting.append(rest)
            self._pushed += 1
        except BlockingIOError:
            self.dropped += 1
        except OSError:
            self._gone = "the recorder was killed"

    def event(self, event: Event) -> None:
        """Hand over an event with the next tick that finds room in the pipe."""
        data = json.dumps(event_record(event)).encode()
        self._waiting.append(FRAME.pack(EVENT, len(data)) + data)

    def close(self) -> Outcome:
        """Let the recorder finish; it is killed if the wait for it is interrupted."""
        assert self.process.stdin
        if self.process.stdin.closed:
            return Outcome(self.path, 0, 0, self._gone)
        try:
            return self._finish()
        except BaseException:
            self.process.kill()
            self._release()
            raise

    def _finish(self) -> Outcome:
        assert self.process.stdin
        with self._patience():
            with contextlib.suppress(OSError):
                if hasattr(os, "set_blocking"):
                    os.set_blocking(self._pipe, True)
                for data in self._waiting:
                    os.write(self._pipe, data)
                os.write(self._pipe, number_frame(END, self.dropped))
            with contextlib.suppress(OSError):
                self.process.stdin.close()
        status = self._status()
        if status is None:
            self.process.kill()
            status = {"problem": self._gone or "the recorder was killed"}
        self._release()
        at_path = status.get("at_path", True)
        return Outcome(self.path, self._pushed, self.dropped, status["problem"], at_path)

    def _release(self) -> None:
        """Wait for the process to end, and let go of its pipes."""
        assert self.process.stdin
        assert self.process.stdout
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()

    def _status(self) -> dict[str, Any] | None:
        """What the recorder says next; None if it is gone, or says nothing for too long."""
        assert self.process.stdout
        with self._patience():
            line = self.process.stdout.readline()
        status: dict[str, Any] | None = json.loads(line) if line.endswith(b"\n") else None
        return status

    @contextlib.contextmanager
    def _patience(self) -> Iterator[None]:
        """Kill a recorder that keeps the control process waiting for too long."""
        watchdog = threading.Timer(PATIENCE, self.process.kill)
        watchdog.start()
        try:
            yield
        finally:
            watchdog.cancel()


def number_frame(kind: bytes, number: int) -> bytes:
    """A frame that carries one number."""
    return FRAME.pack(kind, NUMBER.size) + NUMBER.pack(number)


def event_record(event: Event) -> dict[str, Any]:
    """An event as JSON has it."""
    record: dict[str, Any] = finite(event._asdict())
    return record | {
        "mode": event.mode.name.lower(),
        "text": event.text[:LONGEST_TEXT],
        "fault": event.fault and str(event.fault),
        "source": event.source[:100],
    }
