"""A reader of a stream, in the process of the control loop or in a process of its own."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from teleop.errors import InputError
from teleop.streams.control_pipe import ControlPipe
from teleop.streams.stream import StreamReader

Send = Callable[[dict[str, Any]], None]
"""Function that sends a message, which JSON allows, to the control process."""


class Reader(ABC):
    """Reads a stream, and sends messages about it to the control process."""

    def __init__(self, stream: StreamReader, send: Send) -> None:
        self.stream, self.send = stream, send

    @abstractmethod
    def advance(self) -> None:
        """Read what is new in the stream."""

    def finish(self) -> dict[str, Any]:
        """Read the rest of the stream, and return the last message; `problem` is a text in it."""
        return {"problem": ""}


def run_reader(
    name: str,
    make: Callable[[Mapping[str, Any], StreamReader, Send], Reader],
    period: float,
) -> None:
    """Run a reader in this process until the control process closes the pipe, or has ended.

    `name` is one of `teleop.streams.stream.READERS`. `make` creates the reader from the
    description of the session. `period` is the time between two reads of the stream [s]; it is
    longer after a long read, so that a tenth of the processor remains for other programs.
    """
    pipe = ControlPipe()
    try:
        session = pipe.read_line()
        reader = make(session, StreamReader.open(session["stream"], name), pipe.send)
    except EOFError:  # the control process has ended before
        return
    except InputError as problem:
        pipe.send({"problem": str(problem)})
        return
    pipe.send({"problem": ""})
    while not pipe.ended:
        start = time.monotonic()
        reader.advance()
        time.sleep(max(period, (time.monotonic() - start) / 9.0))
    pipe.send(reader.finish())
    for path in session["stream"]["files"].values():  # a control process that was killed has not
        Path(path).unlink(missing_ok=True)
