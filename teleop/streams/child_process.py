"""Start a process that reads a stream, and exchange messages with it."""

from __future__ import annotations

import contextlib
import os
import queue
import subprocess
import sys
import threading
from typing import Any

from drivers.posix import is_posix
from teleop.errors import InputError, reason
from teleop.json_documents import dumps, loads

LIVE_PROCESS = "teleop.live.process"
"""Module of the live process."""
START_TIME = 20.0
"""Longest wait for the start of a process [s]."""
END_TIME = 3.0
"""Longest wait for the end of a process [s]."""
MOST_UNSENT = 1 << 20
"""Number of unsent bytes above which a process is killed, because it no longer reads."""


class ChildProcess:
    """A process that reads a stream. It exchanges JSON documents with this process.

    The constructor only starts the process, which then imports its modules and waits for `begin`. A
    thread of this process waits for its messages, so that the control loop needs no system call.

    Attributes
    ----------
    pid
        Process id.
    url
        Address at which the process serves the data; empty before `begin`, and without a server.
    """

    def __init__(self, module: str, what: str = "live page") -> None:
        self._what = what
        self._unsent = b""
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                bufsize=0,
                start_new_session=is_posix(),
            )
        except OSError as error:
            raise InputError(f"{what}: cannot be started: {reason(error)}") from error
        assert self._process.stdin
        assert self._process.stdout
        self._input, self._output = self._process.stdin, self._process.stdout
        if hasattr(os, "set_blocking"):
            os.set_blocking(self._input.fileno(), False)
        self.pid = self._process.pid
        self.url = ""
        self._serves = False
        self._messages: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def _receive(self) -> None:
        """Collect the messages of the process; the empty text is its end."""
        received = b""
        with contextlib.suppress(OSError, ValueError):
            while part := self._output.read(1 << 16):
                *lines, received = (received + part).split(b"\n")
                for line in lines:
                    self._messages.put(line)
        self._messages.put(b"")
        self._output.close()

    def begin(self, session: dict[str, Any]) -> None:
        """Send the description of the session, and wait until the process is ready.

        InputError if it does not start, or if it answers with a problem.
        """
        self.tell(session)
        ready = self.wait_for_request(START_TIME) or {"problem": "it did not start"}
        if ready.get("problem"):
            self.end()
            raise InputError(f"{self._what}: {ready['problem']}")
        self.url = str(ready.get("url", ""))
        self._serves = True

    def tell(self, document: dict[str, Any]) -> None:
        """Send a message to the process.

        This method does not wait. The part of the message that the process cannot receive now
        is sent at the next call. If this part is longer than `MOST_UNSENT`, the process is killed,
        because it hangs.
        """
        self._unsent += dumps(document).encode() + b"\n"
        self._send()

    def _send(self) -> None:
        """Send what the process can receive now of the part that is not sent yet."""
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
        """Wait for the next message of the process, and return it.

        The result is None if there was no message, or if the process has ended.
        """
        self._send()
        try:
            line = self._messages.get(timeout=timeout)
        except queue.Empty:
            return None
        if not line:
            self._messages.put(b"")  # each later call must find the end, too
            return None
        return loads(line)

    @property
    def has_message(self) -> bool:
        """Whether a message has arrived, or the process has ended. This needs no system call."""
        return not self._messages.empty()

    @property
    def is_running(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def ask_to_end(self) -> None:
        """Let the process end, and do not wait."""
        with contextlib.suppress(OSError):
            self._input.close()

    def finish(self, timeout: float) -> list[dict[str, Any]]:
        """Let the process end, and return the rest of its messages.

        The last one has the key `problem`, unless the process was killed. A process that does not
        end in time is killed.
        """
        self.ask_to_end()
        messages = []
        while (message := self.wait_for_request(timeout)) is not None:
            messages.append(message)
        self.end()
        return messages

    def end(self) -> None:
        """End the process. If it does not end within `END_TIME`, it is killed.

        Before it ends, the live process reports the end to the open live pages. A process that is
        not ready yet is killed at once.
        """
        self.ask_to_end()
        try:
            if not self._serves:
                self._process.kill()
            self._process.wait(END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join(END_TIME)

    def move_off(self) -> None:
        """Do not permit the process to use the processor on which the control loop runs.

        Nothing is changed if the control loop may use more than one processor, or if there is no
        other processor.
        """
        if not hasattr(os, "sched_setaffinity"):
            return
        own = os.sched_getaffinity(0)
        with contextlib.suppress(OSError):
            others = os.sched_getaffinity(self._process.pid) - own
            if len(own) == 1 and others:
                os.sched_setaffinity(self._process.pid, others)
