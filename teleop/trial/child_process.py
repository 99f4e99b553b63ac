"""Start a process that shows the data of the trials, and exchange messages with it."""

from __future__ import annotations

import contextlib
import os
import select
import subprocess
import sys
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
    """A process that shows the data of the trials. It exchanges JSON documents with this process.

    The constructor only starts the process, which then imports its modules and waits for `begin`.

    Attributes
    ----------
    pid
        Process id.
    url
        Address at which the process serves the data; empty before `begin`.
    """

    def __init__(self, module: str, what: str = "live page") -> None:
        self._unsent = b""
        self._received = b""
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
        os.set_blocking(self._input.fileno(), False)
        self.pid = self._process.pid
        self.url = ""

    def begin(self, session: dict[str, Any]) -> None:
        """Send the description of the session, and wait until the process serves the data."""
        self.tell(session)
        ready = self.wait_for_request(START_TIME) or {"problem": "it did not start"}
        if "problem" in ready:
            self.end()
            raise InputError(f"live page: {ready['problem']}")
        self.url = str(ready["url"])

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
        """Whether the process is running."""
        return self._process.poll() is None

    def ask_to_end(self) -> None:
        """Let the process end, and do not wait."""
        with contextlib.suppress(OSError):
            self._input.close()

    def end(self) -> None:
        """End the process. If it does not end within `END_TIME`, it is killed.

        Before it ends, the live process reports the end to the open live pages. A process that does
        not serve data yet is killed at once.
        """
        self.ask_to_end()
        try:
            if not self.url:
                self._process.kill()
            self._process.wait(END_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._output.close()

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
