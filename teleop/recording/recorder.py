"""Start the recorder process, and send the ticks and events of the control loop to it."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from drivers.posix import is_posix, posix_module
from estimation.estimator import LEVEL_95
from estimation.misfit import LARGEST_MISFIT
from teleop.errors import InputError, reason
from teleop.recording.columns import Layout
from teleop.recording.process import BEGIN, END, EVENT, FRAME, HEAD, TICK, number_frame
from teleop.recording.sinks import Outcome, Sink, event_record
from teleop.safety import Event

PIPE_SIZE = 1 << 20
"""Requested size of the pipe's buffer [bytes], enough for about two seconds of ticks.

Linux allows every user this size by default, but no larger size.
"""
BACKLOG = 4 << 20
"""Largest size of the ticks that wait in the memory of the loop while the pipe is full [bytes].

With three estimators, this is enough for a pause of the recorder of nine seconds at 1 kHz.
"""
CATCH_UP = 4
"""Largest number of waiting messages that are sent at one tick, so that the tick remains short."""
TIMEOUT = 20.0
"""Longest time for which the control process waits for the recorder to start, or to end [s]."""


class RecorderProcess(Sink):
    """Starts the recorder process, and sends the ticks and events of a trial to it.

    `path` is None if the process only shows the progress line. With `wait`, the loop waits while
    the pipe to the recorder is full, for a simulation in virtual time. Otherwise ticks are kept in
    memory while the pipe is full, and dropped if too many are kept. `hint` and `instructions` are
    texts of the progress line about how to stop. `cue` contains the largest displacement of the
    target [m] and its count-in [s], or is None if there is no target.
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
        cue: tuple[float, float] | None = None,
    ) -> None:
        self.path = path
        self._pushed = 0
        self._waiting: deque[bytes] = deque()
        self._most = BACKLOG // layout.size
        self._failure = ""
        self._head = FRAME.pack(TICK, layout.size)
        self._wait = wait
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "teleop.recording.process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                bufsize=0,
                start_new_session=is_posix(),
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
            "largest_misfit": LARGEST_MISFIT,
            "level": LEVEL_95,
            "definition": layout.definition,
            "metadata": metadata,
            "duration": duration,
            "show": show,
            "hint": hint,
            "instructions": instructions,
            "cue": cue,
            "overwrite": overwrite,
        }
        data = json.dumps(session).encode()
        try:
            self.process.stdin.write(HEAD.pack(len(data)) + data)
        except BrokenPipeError:
            self._failure = "the recorder did not start"

    def begin(self, start: int) -> None:
        """Wait until the recorder has opened the file. Call this method before the first `push`.

        `start` is the wall-clock time of the beginning of the trial [ns].
        """
        status = self._status()
        if status is None or status["problem"]:
            self.process.kill()
            self._release()
            cause = status["problem"] if status else "the recorder did not start"
            raise InputError(f"{self.path or 'progress line'}: recording failed: {cause}")
        with contextlib.suppress(BrokenPipeError):
            os.write(self._pipe, number_frame(BEGIN, start))
        fcntl = posix_module("fcntl")
        if fcntl and hasattr(fcntl, "F_SETPIPE_SZ"):  # Linux
            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
        if not self._wait and hasattr(os, "set_blocking"):
            os.set_blocking(self._pipe, False)

    def push(self, message: bytes) -> None:
        """Send a tick to the recorder; keep it if the pipe is full, and drop it above `BACKLOG`."""
        if self._failure:
            return
        waiting = self._waiting
        if len(waiting) < self._most:
            waiting.append(self._head + message)
            self._pushed += 1
        else:
            self.dropped += 1
        try:
            for _ in range(min(CATCH_UP, len(waiting))):
                if rest := waiting[0][os.write(self._pipe, waiting[0]) :]:
                    waiting[0] = rest
                    return
                waiting.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self._failure = "the recorder was killed"

    def event(self, event: Event) -> None:
        """Keep an event. The next `push` sends it before its own message, or `close` sends it.

        The message of the tick of the event was pushed before the event.
        """
        data = json.dumps(event_record(event)).encode()
        self._waiting.append(FRAME.pack(EVENT, len(data)) + data)

    def close(self) -> Outcome:
        """Wait until the recorder has completed the file, and return the result of the recording.

        If an exception, such as KeyboardInterrupt, interrupts the wait, the recorder is killed.
        """
        assert self.process.stdin
        if self.process.stdin.closed:
            return Outcome(self.path, 0, 0, self._failure)
        try:
            return self._finish()
        except BaseException:
            self.process.kill()
            self._release()
            raise

    def _finish(self) -> Outcome:
        assert self.process.stdin
        with self._timeout():
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
            status = {"problem": self._failure or "the recorder was killed"}
        self._release()
        at_path = status.get("at_path", True)
        return Outcome(self.path, self._pushed, self.dropped, status["problem"], at_path)

    def _release(self) -> None:
        """Close the pipes of the recorder process, and wait until the process has ended."""
        assert self.process.stdin
        assert self.process.stdout
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()

    def _status(self) -> dict[str, Any] | None:
        """Return the next status (see `process.send`); None if the recorder has ended or hangs."""
        assert self.process.stdout
        with self._timeout():
            line = self.process.stdout.readline()
        status: dict[str, Any] | None = json.loads(line) if line.endswith(b"\n") else None
        return status

    @contextlib.contextmanager
    def _timeout(self) -> Iterator[None]:
        """Kill the recorder if the `with` block takes longer than `TIMEOUT`."""
        watchdog = threading.Timer(TIMEOUT, self.process.kill)
        watchdog.start()
        try:
            yield
        finally:
            watchdog.cancel()
